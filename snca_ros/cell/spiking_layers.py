"""One control step of layers of spiking neurons, whose lanes are neurons or robots (see `network`).

A layer completes all its SNN steps before the next layer starts, which is possible because the
network is feed-forward and has no delay between layers. So the state of a neuron stays in registers
during its SNN steps. Only the weights of presynaptic neurons that fire are read.

For one robot, the words of `fired` hold the neurons that fire. For W robots, the spikes of a neuron
in an SNN step are a mask over the robots, stored as an integer in `trains` (bit i is the robot in
lane i), and `fired` holds the neurons that fire in at least one robot.
"""

from numba.cpython.unsafe.numbers import trailing_zeros

from sim_node.numerics.dispatch import by_attribute
from sim_node.numerics.jit import compiled_part, inlined_part
from sim_node.numerics.lane_tuples import all_equal, load_each, store_each
from sim_node.numerics.lanes import any_lane, bits_of, like, load, mask_like, negation, select
from snca_ros.cell.coding import SNN_STEPS
from snca_ros.cell.layers import PAIR
from snca_ros.cell.models.model import bias, rounded, step
from snca_ros.cell.network import NEURONS, WORD

_OCTET = (1 << NEURONS) - 1


@compiled_part
def run_spiking(network, cell, trains):
    """Run the network of one cell, of one robot or of W robots, for one control step.

    Args:
        network: `fired` holds on entry the input neurons that receive a spike (for one robot), and
            at the end the output neurons that fire.
        cell: index of the cell.
        trains: None for one robot; for W robots (n_items, SNN_STEPS) masks, on entry those of the
            input layer; all are written.
    """
    row = network.rows[cell]
    first = synapse = pre = 0
    for layer in range(network.sizes.shape[0]):
        n = network.items[layer]
        _move_spikes(network.presynaptic, network.fired)
        _run_layer(network, cell, row, pre, first, n, synapse, trains)
        _clear_padding(network.fired, network.sizes[layer])
        synapse += network.sizes[layer - 1] * n if layer > 0 else 0
        first, pre = first + n, n


@inlined_part
def _resting(model, start, state_j, state_k, trains, j, k):
    """Return whether two input neurons of W robots are in the reset state and receive no spike."""
    spiking = 0
    for h in range(SNN_STEPS):
        spiking |= trains[j, h] | trains[k, h]
    mask = state_j[0] == start[0]
    at_reset = all_equal(all_equal(mask, state_j, start), state_k, start)
    return spiking == 0 and not any_lane(negation(at_reset))


@inlined_part
def _never(model, start, state_j, state_k, trains, j, k):
    return False


_at_rest = by_attribute(
    'rests', {True: _resting, False: _never},
    'Return whether a step of two input neurons would change nothing and produce no spike.',
    default=False,
)


@inlined_part
def clear(fired):
    """Clear all (n_words, SNN_STEPS) words, so that no neuron fires."""
    for word in range(fired.shape[0]):
        for h in range(SNN_STEPS):
            fired[word, h] = 0


@inlined_part
def _move_spikes(presynaptic, fired):
    """Move the spikes of a layer to the presynaptic neurons of the next one."""
    for word in range(fired.shape[0]):
        for h in range(SNN_STEPS):
            presynaptic[word, h], fired[word, h] = fired[word, h], 0


@inlined_part
def _clear_padding(fired, size):
    """Clear the bits of neurons that are padding."""
    for word in range(fired.shape[0]):
        n = size - WORD * word
        if n < WORD:
            real = (1 << max(n, 0)) - 1
            for h in range(SNN_STEPS):
                fired[word, h] &= real


@inlined_part
def _run_layer(network, cell, row, pre, first, n, synapse, trains):
    """Run a layer for one control step.

    Args:
        pre: number of items of the previous layer; 0 for the input layer, each neuron of which
            receives its own train with weight 1.
        first, n, synapse: the layer's first item, its number of items, and its first synapse.
            The other arguments are those of `run_spiking`.
    """
    model, weights = network.model, network.weights
    presynaptic, fired = network.presynaptic, network.fired
    zero = like(load(weights, row, 0), 0.0)
    for i in range(0, n, PAIR):
        j, k = first + i, first + i + 1
        state_j, state_k = load_each(network.state, cell, j), load_each(network.state, cell, k)
        if trains is not None:  # noqa: SIM102 - decided at compile time, unlike the next
            if pre == 0 and _at_rest(model, network.start, state_j, state_k, trains, j, k):
                continue
        own_j, own_k = load_each(network.own, row, j), load_each(network.own, row, k)
        for h in range(SNN_STEPS):
            total_j, total_k = zero + bias(model, own_j), zero + bias(model, own_k)
            if pre == 0:
                if trains is None:
                    pair = presynaptic[i * NEURONS // WORD, h] >> (i * NEURONS % WORD)
                    input_j, input_k = pair & _OCTET, (pair >> NEURONS) & _OCTET
                else:
                    input_j, input_k = trains[j, h], trains[k, h]
                total_j = select(mask_like(zero, input_j), total_j + 1.0, total_j)
                total_k = select(mask_like(zero, input_k), total_k + 1.0, total_k)
            else:
                for word in range(presynaptic.shape[0]):
                    remaining = presynaptic[word, h]
                    while remaining != 0:
                        e = WORD * word + trailing_zeros(remaining)
                        remaining &= remaining - 1
                        m = synapse + e * n + i
                        if trains is None:
                            total_j = rounded(model, total_j + load(weights, row, m))
                            total_k = rounded(model, total_k + load(weights, row, m + 1))
                        else:
                            mask = mask_like(zero, trains[first - pre + e, h])
                            sum_j = rounded(model, total_j + load(weights, row, m))
                            sum_k = rounded(model, total_k + load(weights, row, m + 1))
                            total_j = select(mask, sum_j, total_j)
                            total_k = select(mask, sum_k, total_k)
            spikes_j, state_j = step(model, state_j, own_j, total_j)
            spikes_k, state_k = step(model, state_k, own_k, total_k)
            fired_j, fired_k = bits_of(spikes_j), bits_of(spikes_k)
            if trains is None:
                pair = fired_j | fired_k << NEURONS
                fired[i * NEURONS // WORD, h] |= pair << (i * NEURONS % WORD)
            else:
                trains[j, h], trains[k, h] = fired_j, fired_k
                fired[i // WORD, h] |= ((fired_j != 0) | (fired_k != 0) << 1) << i % WORD
        store_each(network.state, cell, j, state_j)
        store_each(network.state, cell, k, state_k)
