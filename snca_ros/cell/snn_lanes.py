"""The spiking network of `snn` for W robots side by side, one in each lane.

The spikes of a neuron in an SNN step are a mask over the robots, kept as an integer: bit i is the
robot in lane i. So a train is (SNN_STEPS,) masks. All layers' neurons come one after the other.

Within a layer a neuron's state stays in registers through its SNN steps; only presynaptic neurons
that fire for some robot are looked at.
"""

from numba.cpython.unsafe.numbers import trailing_zeros

from sim_node.numerics.jit import compiled, inlined_part
from sim_node.numerics.lanes import any_lane, bits_of, like, load, mask_like, select, store
from snca_ros.cell import snn
from snca_ros.cell.coding import SNN_STEPS

PAIR = 2
"""Neurons that step by turns, for each has to wait for its own last step; layers are padded to
whole pairs."""

WORD = 64
"""Neurons whose firing one integer tells: bit i of word w is neuron 64 w + i of a layer."""


@compiled
def run_network(
    lif, cell, row, sizes, weights, ceilings, v, psi, theta, trains, heard, fired
):
    """Run the network of one cell of every robot through one control step, as in `snn`.

    Args:
        lif: the neuron model's constants.
        cell, row: whose state, and whose weights and ceilings.
        sizes: (n_layers,) neurons per layer.
        weights: lanes (n_rows, n_synapses) of `pad_synapses` to a multiple of PAIR.
        ceilings: lanes (n_rows, n_neurons) of `snn.threshold_ceilings`, a layer after the other.
        v, psi, theta: lanes (n_cells, n_neurons) state [mV] of `snn.step_neuron`, written; no
            theta (None) but in the model as printed.
        trains: (n_neurons, SNN_STEPS) masks; those of the input layer come in, all leave as the
            layers'.
        heard, fired: (n_words, SNN_STEPS) scratch: which neurons of the layer before, and of the
            layer that runs, fire in a step for some robot.
    """
    fired[:] = 0
    first = synapse = pre = 0
    for layer in range(sizes.shape[0]):
        n = (sizes[layer] + PAIR - 1) // PAIR * PAIR
        heard[:] = fired
        fired[:] = 0
        run_layer(
            lif, cell, row, pre, first, n, synapse, weights, ceilings, v, psi, theta,
            trains, heard, fired,
        )
        synapse += sizes[layer - 1] * n if layer > 0 else 0
        first, pre = first + n, n


@inlined_part
def run_layer(
    lif, cell, row, pre, first, n, synapse, weights, ceilings, v, psi, theta, trains, heard, fired
):
    """Run a layer through a control step: what `snn.propagate` and `snn.fire` do.

    Args:
        pre: neurons of the layer before, padded; 0 for the input layer, whose neurons are fed by
            their own trains with weight 1.
        first, n, synapse: the layer's first neuron, how many it has, and its first synapse.
            The other arguments are as of `run_network`.
    """
    for i in range(0, n, PAIR):
        j, k = first + i, first + i + 1
        v_j, v_k = load(v, cell, j), load(v, cell, k)
        psi_j, psi_k = load(psi, cell, j), load(psi, cell, k)
        if pre == 0:  # what has never heard anything rests, and sends nothing
            at_rest = (v_j == 0.0) & (v_k == 0.0) & (psi_j == 0.0) & (psi_k == 0.0)
            spiking = 0
            for h in range(SNN_STEPS):
                spiking |= trains[j, h] | trains[k, h]
            if spiking == 0 and not any_lane(~at_rest):
                continue
        ceiling_j, ceiling_k = load(ceilings, row, j), load(ceilings, row, k)
        rest_j, rest_k = min(snn.THETA_0, ceiling_j), min(snn.THETA_0, ceiling_k)
        if theta is not None:
            theta_j, theta_k = load(theta, cell, j), load(theta, cell, k)
        robots = bits_of(like(v_j, 0.0) == 0.0)
        for h in range(SNN_STEPS):
            current_j = current_k = like(v_j, 0.0)
            if pre == 0:
                current_j = select(mask_like(v_j, trains[j, h]), 1.0, current_j)
                current_k = select(mask_like(v_k, trains[k, h]), 1.0, current_k)
            for word in range(heard.shape[0]):
                waiting = heard[word, h]
                while waiting != 0:
                    e = WORD * word + trailing_zeros(waiting)
                    waiting &= waiting - 1
                    spikes = mask_like(v_j, trains[first - pre + e, h])
                    m = synapse + e * n + i
                    current_j = select(spikes, current_j + load(weights, row, m), current_j)
                    current_k = select(spikes, current_k + load(weights, row, m + 1), current_k)
            if theta is None:
                silent_j, v_j, psi_j = snn.step_neuron(lif, v_j, psi_j, rest_j, current_j)
                silent_k, v_k, psi_k = snn.step_neuron(lif, v_k, psi_k, rest_k, current_k)
            else:
                silent_j, v_j, psi_j, theta_j = snn.step_neuron_as_printed(
                    lif, v_j, psi_j, theta_j, ceiling_j, current_j
                )
                silent_k, v_k, psi_k, theta_k = snn.step_neuron_as_printed(
                    lif, v_k, psi_k, theta_k, ceiling_k, current_k
                )
            fired_j, fired_k = robots ^ bits_of(silent_j), robots ^ bits_of(silent_k)
            trains[j, h], trains[k, h] = fired_j, fired_k
            fired[i // WORD, h] |= ((fired_j != 0) | (fired_k != 0) << 1) << i % WORD
        store(v, cell, j, v_j)
        store(v, cell, k, v_k)
        store(psi, cell, j, psi_j)
        store(psi, cell, k, psi_k)
        if theta is not None:
            store(theta, cell, j, theta_j)
            store(theta, cell, k, theta_k)
