"""The multi-layer perceptron of `mlp` for W robots side by side, one in each lane."""

from sim_node.numerics.elementary_functions import tanh
from sim_node.numerics.jit import compiled
from sim_node.numerics.lanes import load, store


@compiled
def run_network(row, sizes, weights, values):
    """Compute the network of one cell of every robot, as in `mlp`.

    Args:
        row: whose weights.
        sizes: (n_layers,) neurons per layer.
        weights: lanes (n_rows, n_synapses); per layer the biases, then a row per presynaptic
            neuron.
        values: lanes (1, n_neurons), layer after layer; inputs in layer 0; all leave as
            activations.
    """
    for j in range(sizes[0]):
        store(values, 0, j, tanh(load(values, 0, j)))
    first, synapse = sizes[0], 0
    for layer in range(1, sizes.shape[0]):
        pre, n = sizes[layer - 1], sizes[layer]
        for j in range(n):
            total = load(weights, row, synapse + j)
            for i in range(pre):
                w = load(weights, row, synapse + (1 + i) * n + j)
                total += w * load(values, 0, first - pre + i)
            store(values, 0, first + j, tanh(total))
        first += n
        synapse += (1 + pre) * n
