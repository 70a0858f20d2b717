"""Multi-layer perceptron with tanh everywhere, inputs included (2D-VSR-Sim)."""

from sim_node.numerics.elementary_functions import tanh
from sim_node.numerics.jit import compiled_kernel
from snca_ros.cell.layers import LANES


@compiled_kernel
def run_networks(first, last, rows, sizes, weights, values):
    """Compute the networks of some cells: y = tanh(b + sum_i w_i x_i), tanh on inputs too.

    Args:
        first, last: the cells from `first` to, but not with, `last`.
        rows: (n_cells,) which row of weights a cell runs.
        sizes: (n_layers,) neurons per layer.
        weights: (n_rows, ...) of `pad_synapses`; per layer the biases, then a row per
            presynaptic neuron.
        values: (n_cells, n_layers, widest); inputs in layer 0; all leave as activations.
    """
    for cell in range(first, last):
        row, synapse = rows[cell], 0
        for layer in range(sizes.shape[0]):
            n = (sizes[layer] + LANES - 1) // LANES * LANES
            if layer > 0:
                for j in range(n):
                    values[cell, layer, j] = weights[row, synapse + j]
                for i in range(sizes[layer - 1]):
                    synapse += n
                    x = values[cell, layer - 1, i]
                    for j in range(n):
                        values[cell, layer, j] += weights[row, synapse + j] * x
                synapse += n
            for j in range(n):
                values[cell, layer, j] = tanh(values[cell, layer, j])
