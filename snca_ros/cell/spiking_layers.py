"""Layers of spiking neurons through a control step, whatever a lane is (see `network`).

Within a layer a neuron's state stays in registers through its SNN steps. A feed-forward network may
finish a layer's SNN steps before it starts the next layer: there is no delay between layers. Only
presynaptic neurons that fire are looked at.

Of one robot, who fires is in the words of `fired`. Of W robots, the spikes of a neuron in an SNN
step are a mask over the robots, kept as an integer in `trains` (bit i is the robot in lane i), and
`fired` has the neurons that fire for some robot.
"""

from numba.cpython.unsafe.numbers import trailing_zeros

from sim_node.numerics.dispatch import by_attribute
from sim_node.numerics.jit import compiled_part, inlined_part
from sim_node.numerics.lane_tuples import all_equal, load_each, store_each
from sim_node.numerics.lanes import any_lane, bits_of, like, load, mask_like, negation, select
from snca_ros.cell.coding import SNN_STEPS
from snca_ros.cell.layers import PAIR
from snca_ros.cell.models.model import bias, step
from snca_ros.cell.network import NEURONS, WORD

_OCTET = (1 << NEURONS) - 1


@compiled_part
def run_spiking(network, cell, trains):
    """Run the network of one cell, of one robot or of W, through one control step.

    Args:
        network: on entry the neurons of the input layer that get a spike are in `fired` (of one
            robot); at the end those of the output layer that fire are.
        cell: which cell.
        trains: None of one robot; of W robots (n_items, SNN_STEPS) masks, those of the input layer
            on entry, all written.
    """
    row = network.rows[cell]
    first = synapse = pre = 0
    for layer in range(network.sizes.shape[0]):
        n = network.items[layer]
        _hand_over(network.heard, network.fired)
        _run_layer(network, cell, row, pre, first, n, synapse, trains)
        _forget_padding(network.fired, network.sizes[layer])
        synapse += network.sizes[layer - 1] * n if layer > 0 else 0
        first, pre = first + n, n


@inlined_part
def _resting(model, start, state_j, state_k, trains, j, k):
    """Return whether two input neurons of W robots are as at reset and get no spike."""
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
    'Return whether a step of two input neurons would change nothing and give no spike.',
    default=False,
)


@inlined_part
def clear(fired):
    """Let no neuron fire, in (n_words, SNN_STEPS)."""
    for word in range(fired.shape[0]):
        for h in range(SNN_STEPS):
            fired[word, h] = 0


@inlined_part
def _hand_over(heard, fired):
    """Move the neurons that fire to those that the next layer hears."""
    for word in range(fired.shape[0]):
        for h in range(SNN_STEPS):
            heard[word, h], fired[word, h] = fired[word, h], 0


@inlined_part
def _forget_padding(fired, size):
    """Remove neurons that are padding from those that fire."""
    for word in range(fired.shape[0]):
        n = size - WORD * word
        if n < WORD:
            real = (1 << max(n, 0)) - 1
            for h in range(SNN_STEPS):
                fired[word, h] &= real


@inlined_part
def _run_layer(network, cell, row, pre, first, n, synapse, trains):
    """Run a layer through a control step.

    Args:
        pre: items of the layer before; 0 for the input layer, each neuron of which gets its own
            train with weight 1.
        first, n, synapse: the layer's first item, how many it has, and its first synapse.
            The other arguments are as of `run_spiking`.
    """
    model, weights, heard, fired = network.model, network.weights, network.heard, network.fired
    zero = like(load(weights, row, 0), 0.0)
    for i in range(0, n, PAIR):
        j, k = first + i, first + i + 1
        state_j, state_k = load_each(network.state, cell, j), load_each(network.state, cell, k)
        if trains is not None:  # noqa: SIM102 - known when it is compiled, unlike the next
            if pre == 0 and _at_rest(model, network.start, state_j, state_k, trains, j, k):
                continue
        own_j, own_k = load_each(network.own, row, j), load_each(network.own, row, k)
        for h in range(SNN_STEPS):
            total_j, total_k = zero + bias(model, own_j), zero + bias(model, own_k)
            if pre == 0:
                if trains is None:
                    pair = heard[i * NEURONS // WORD, h] >> (i * NEURONS % WORD)
                    input_j, input_k = pair & _OCTET, (pair >> NEURONS) & _OCTET
                else:
                    input_j, input_k = trains[j, h], trains[k, h]
                total_j = select(mask_like(zero, input_j), total_j + 1.0, total_j)
                total_k = select(mask_like(zero, input_k), total_k + 1.0, total_k)
            else:
                for word in range(heard.shape[0]):
                    waiting = heard[word, h]
                    while waiting != 0:
                        e = WORD * word + trailing_zeros(waiting)
                        waiting &= waiting - 1
                        m = synapse + e * n + i
                        if trains is None:
                            total_j = total_j + load(weights, row, m)
                            total_k = total_k + load(weights, row, m + 1)
                        else:
                            heard_by = mask_like(zero, trains[first - pre + e, h])
                            total_j = select(heard_by, total_j + load(weights, row, m), total_j)
                            total_k = select(heard_by, total_k + load(weights, row, m + 1), total_k)
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
