"""Multi-layer perceptron with tanh everywhere, inputs included (2D-VSR-Sim)."""

import math

from sim_node.compiled import compiled


def n_weights(sizes: tuple[int, ...]) -> int:
    """Return the number of weights and biases of fully connected layers of these sizes."""
    return sum((a + 1) * b for a, b in zip(sizes[:-1], sizes[1:], strict=True))


@compiled
def run_network(sizes, weights, values):
    """Compute all layers: y = tanh(b + sum_i w_i x_i), with tanh on the inputs too.

    Args:
        sizes: (n_layers,) neurons per layer.
        weights: layer by layer; per layer the biases, then a row per presynaptic neuron.
        values: (n_layers, widest) row 0 holds the inputs; all rows leave as activations.
    """
    for i in range(sizes[0]):
        values[0, i] = math.tanh(values[0, i])
    synapse = 0
    for layer in range(1, sizes.shape[0]):
        pre, post = sizes[layer - 1], sizes[layer]
        for j in range(post):
            values[layer, j] = weights[synapse + j]
        for i in range(pre):
            row = synapse + (i + 1) * post
            for j in range(post):
                values[layer, j] += weights[row + j] * values[layer - 1, i]
        for j in range(post):
            values[layer, j] = math.tanh(values[layer, j])
        synapse += (pre + 1) * post
