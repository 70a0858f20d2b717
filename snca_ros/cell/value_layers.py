"""One control step of layers of neurons that send values; lanes are neurons or robots."""

from sim_node.numerics.jit import compiled_part, inlined_part
from sim_node.numerics.lane_tuples import load_each, store_each
from sim_node.numerics.lanes import like, load, store
from snca_ros.cell.models.model import bias, rounded, step
from snca_ros.cell.network import NEURONS


@compiled_part
def run_values(network, cell, flat):
    """Run the network of one cell, of one robot or of W robots, for one control step.

    Args:
        network: `values` holds on entry the values of the input layer, at the end of all layers.
        cell: index of the cell.
        flat: None for W robots; for one robot, `values` as an array of one number per neuron.
    """
    row = network.rows[cell]
    first = synapse = pre = 0
    for layer in range(network.sizes.shape[0]):
        n = network.items[layer]
        neurons = network.sizes[layer - 1] if layer > 0 else 0
        _run_layer(network, cell, row, pre, neurons, first, n, synapse, flat)
        synapse += neurons * n
        first, pre = first + n, n


@inlined_part
def _run_layer(network, cell, row, pre, neurons, first, n, synapse, flat):
    """Run a layer: y = step(bias + sum of weight times value).

    Args:
        pre, neurons: numbers of items and neurons of the previous layer; 0 for the input layer,
            whose totals are its values.
        first, n, synapse: the layer's first item, its number of items, and its first synapse.
    """
    model, weights, values = network.model, network.weights, network.values
    for i in range(n):
        j = first + i
        state, own = load_each(network.state, cell, j), load_each(network.own, row, j)
        total = load(values, 0, j)
        if pre > 0:
            total = like(total, 0.0) + bias(model, own)
            for e in range(neurons):
                weight = load(weights, row, synapse + e * n + i)
                if flat is None:
                    product = rounded(model, weight * load(values, 0, first - pre + e))
                else:
                    product = rounded(model, weight * flat[(first - pre) * NEURONS + e])
                total = rounded(model, total + product)
        value, state = step(model, state, own, total)
        store(values, 0, j, value)
        store_each(network.state, cell, j, state)
