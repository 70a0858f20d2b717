"""The spiking network of `snn` for W robots side by side, one in each lane.

The spikes of a neuron in an SNN step are a mask over the robots, kept as an integer: bit i is the
robot in lane i. So a train is (SNN_STEPS,) masks. All layers' neurons come one after the other.

Within a layer a neuron's state stays in registers through its SNN steps; only presynaptic neurons
that fire for some robot are looked at. No helper within these loops takes an array, for numba
would count references to it there.
"""

from typing import NamedTuple

import numpy as np

from sim_node.compiled import compiled, inlined_part
from sim_node.lanes import bits_of, like, load, mask_like, select, store
from snca_ros.cell import snn
from snca_ros.cell.coding import SNN_STEPS
from snca_ros.cell.layers import padded

PAIR = 2
"""Neurons that step by turns, for each has to wait for its own last step; layers are padded to
whole pairs."""


class Spikes(NamedTuple):
    """The spikes of one cell of every robot within a control step.

    Attributes:
        trains: (n_neurons, SNN_STEPS) masks.
        firing: (SNN_STEPS, widest) neurons of a layer that fire in a step for some robot.
        n_firing: (SNN_STEPS,) how many do.
    """

    trains: np.ndarray
    firing: np.ndarray
    n_firing: np.ndarray


def make_spikes(sizes: tuple[int, ...]) -> Spikes:
    """Return room for the spikes of layers of these sizes."""
    return Spikes(
        trains=np.zeros((sum(padded(n, PAIR) for n in sizes), SNN_STEPS), dtype=np.int64),
        firing=np.zeros((SNN_STEPS, max(sizes)), dtype=np.int64),
        n_firing=np.zeros(SNN_STEPS, dtype=np.int64),
    )


@compiled
def run_network(lif, cell, row, sizes, weights, ceilings, v, psi, theta, spikes):
    """Run the network of one cell of every robot through one control step, as in `snn`.

    Args:
        lif: the neuron model's constants.
        cell, row: whose state, and whose weights and ceilings.
        sizes: (n_layers,) neurons per layer.
        weights: lanes (n_rows, n_synapses) of `pad_synapses` to a multiple of PAIR.
        ceilings: lanes (n_rows, n_neurons) of `snn.threshold_ceilings`, a layer after the other.
        v, psi, theta: lanes (n_cells, n_neurons) state [mV], written.
        spikes: `trains` of the input layer come in; all leave as the layers'.
    """
    trains, firing, n_firing = spikes
    before = first = synapse = pre = 0
    for layer in range(sizes.shape[0]):
        n = (sizes[layer] + PAIR - 1) // PAIR * PAIR
        list_firing(before, pre, trains, firing, n_firing)
        if lif.as_printed:
            run_layer_as_printed(
                lif, cell, row, before, pre, first, n, synapse, weights, ceilings, v, psi, theta,
                trains, firing, n_firing,
            )
        else:
            run_layer(
                lif, cell, row, before, pre, first, n, synapse, weights, ceilings, v, psi,
                trains, firing, n_firing,
            )
        synapse += pre * n
        before, pre = first, sizes[layer]
        first += n


@inlined_part
def list_firing(first, n, trains, firing, n_firing):
    """List for each SNN step which of the n neurons from `first` fire for some robot."""
    for h in range(SNN_STEPS):
        last = 0
        for i in range(n):
            firing[h, last] = i
            last += trains[first + i, h] != 0
        n_firing[h] = last


@inlined_part
def run_layer(
    lif, cell, row, before, pre, first, n, synapse, weights, ceilings, v, psi,
    trains, firing, n_firing,
):
    """Run a layer through a control step: what `snn.propagate` and `snn.fire` do.

    Args:
        before, pre: first neuron of the layer before and how many it has; 0 for the input
            layer, whose neurons are fed by their own trains with weight 1.
        first, n, synapse: the layer's first neuron, how many it has, and its first synapse.
            The other arguments are as of `run_network`.
    """
    for i in range(0, n, PAIR):
        j, k = first + i, first + i + 1
        v_j, v_k = load(v, cell, j), load(v, cell, k)
        psi_j, psi_k = load(psi, cell, j), load(psi, cell, k)
        rest_j = min(snn.THETA_0, load(ceilings, row, j))
        rest_k = min(snn.THETA_0, load(ceilings, row, k))
        leaked_j, leaked_k = v_j - lif.leak * v_j, v_k - lif.leak * v_k
        for h in range(SNN_STEPS):
            current_j = current_k = like(v_j, 0.0)
            if pre == 0:
                current_j = select(mask_like(v_j, trains[j, h]), 1.0, current_j)
                current_k = select(mask_like(v_k, trains[k, h]), 1.0, current_k)
            for e in range(n_firing[h]):
                spikes = mask_like(v_j, trains[before + firing[h, e], h])
                m = synapse + firing[h, e] * n + i
                current_j = select(spikes, current_j + load(weights, row, m), current_j)
                current_k = select(spikes, current_k + load(weights, row, m + 1), current_k)
            fired_j, v_j, leaked_j, psi_j = snn.step_neuron(
                lif, leaked_j, psi_j, rest_j, current_j
            )
            fired_k, v_k, leaked_k, psi_k = snn.step_neuron(
                lif, leaked_k, psi_k, rest_k, current_k
            )
            trains[j, h], trains[k, h] = bits_of(fired_j), bits_of(fired_k)
        store(v, cell, j, v_j)
        store(v, cell, k, v_k)
        store(psi, cell, j, psi_j)
        store(psi, cell, k, psi_k)


@inlined_part
def run_layer_as_printed(
    lif, cell, row, before, pre, first, n, synapse, weights, ceilings, v, psi, theta,
    trains, firing, n_firing,
):
    """Run a layer as the paper prints it, `snn.fire_as_printed`; arguments as of `run_layer`."""
    for i in range(n):
        j = first + i
        v_j, psi_j = load(v, cell, j), load(psi, cell, j)
        theta_j, ceiling = load(theta, cell, j), load(ceilings, row, j)
        leaked = v_j - lif.leak * v_j
        for h in range(SNN_STEPS):
            current = like(v_j, 0.0)
            if pre == 0:
                current = select(mask_like(v_j, trains[j, h]), 1.0, current)
            for e in range(n_firing[h]):
                spikes = mask_like(v_j, trains[before + firing[h, e], h])
                w = load(weights, row, synapse + firing[h, e] * n + i)
                current = select(spikes, current + w, current)
            fired, v_j, leaked, psi_j, theta_j = snn.step_neuron_as_printed(
                lif, leaked, psi_j, theta_j, ceiling, current
            )
            trains[j, h] = bits_of(fired)
        store(v, cell, j, v_j)
        store(psi, cell, j, psi_j)
        store(theta, cell, j, theta_j)
