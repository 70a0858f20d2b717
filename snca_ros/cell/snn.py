"""Leaky integrate-and-fire neurons with homeostasis, in fully connected feed-forward layers."""

from typing import NamedTuple

import numpy as np
from numba.cpython.unsafe.numbers import trailing_zeros

from sim_node.numerics.jit import compiled, compiled_inline, compiled_kernel
from sim_node.numerics.lanes import select
from snca_ros.cell.coding import SNN_RATE, SNN_STEPS
from snca_ros.cell.layers import LANES, padded, synapses_by_layer

THETA_0 = 1.0
"""Threshold at rest [mV]."""

V_REST = 0.0
"""Potential after a spike [mV]."""

PSI_INC = 0.2
"""Rise of the homeostatic offset per spike [mV]."""

LEAK = 0.01
"""lambda_v and lambda_psi; [1/ms] as in the authors' code, [1/s] as the paper prints it."""


class Lif(NamedTuple):
    """Constants of a LIF neuron model.

    Attributes:
        leak: lambda times the SNN step, for potential and offset alike.
        psi_inc: rise of the offset per spike [mV]; 0 without homeostasis.
        as_printed: the threshold compounds and a spike needs v > theta, as the paper prints.
    """

    leak: float
    psi_inc: float
    as_printed: bool


def lif_constants(homeostasis: bool, as_printed: bool) -> Lif:
    """Return the constants of the neuron model; `as_printed` follows the paper to the letter."""
    step = 1.0 / SNN_RATE if as_printed else 1000.0 / SNN_RATE
    return Lif(LEAK * step, PSI_INC if homeostasis else 0.0, as_printed)


def threshold_ceilings(
    sizes: tuple[int, ...], weights: np.ndarray, homeostasis: bool
) -> np.ndarray:
    """Return (n_layers, padded widest) upper bounds of the thresholds at rest [mV].

    With homeostasis the sum of a neuron's incoming weights (1 for input neurons), summed in
    presynaptic order; without, no bound.
    """
    ceilings = np.full((len(sizes), padded(max(sizes))), np.inf)
    if homeostasis:
        ceilings[0, : sizes[0]] = 1.0
        for layer, synapses in enumerate(synapses_by_layer(sizes, weights, bias=False), start=1):
            ceilings[layer, : sizes[layer]] = np.add.accumulate(synapses, axis=0)[-1]
    return ceilings


@compiled_kernel
def input_currents(cell, n, trains, currents):
    """Write the currents [mV] of the n input neurons, 1 where their train has a spike."""
    for h in range(SNN_STEPS):
        for j in range(n):
            currents[h, j] = 1.0 if (trains[cell, 0, j] >> h) & 1 else 0.0


@compiled_kernel
def propagate(cell, row, layer, pre, n, weights, synapse, trains, currents):
    """Write the currents [mV] into `layer`: the weights of all synapses that carry a spike.

    Args:
        cell, row: whose trains, and whose weights.
        pre, n: neurons of the layer before and, padded, of this layer.
        weights: (n_rows, ...) of `pad_synapses`; `synapse` is the layer's first.
        trains: (n_cells, n_layers, widest).
        currents: (SNN_STEPS, widest), written.
    """
    for h in range(SNN_STEPS):
        for j in range(n):
            currents[h, j] = 0.0
    for i in range(pre):
        train = trains[cell, layer - 1, i]
        while train != 0:
            h = trailing_zeros(train)
            train &= train - 1
            for j in range(n):
                currents[h, j] += weights[row, synapse + i * n + j]


@compiled_inline
def step_neuron(lif, v, psi, rest, current):
    """Advance a neuron, or one in each lane, by one SNN step (paper, Eq. 1 to 3).

    theta = min(theta_0, ceiling) + psi; v <- v + current; v >= theta: a spike, v <- v_rest,
    psi <- psi + psi_inc; else psi <- psi - lambda dt psi. Then v leaks, ready for the next step:
    v <- v - lambda dt v.

    Args:
        lif: the model's constants.
        v: potential [mV], which has leaked.
        psi: homeostatic offset [mV].
        rest: min(theta_0, ceiling) [mV].
        current: [mV].

    Returns:
        Whether the neuron was silent, and the new v and psi.
    """
    v = v + current
    silent = v < rest + psi
    psi = psi + select(silent, -lif.leak * psi, lif.psi_inc)
    return silent, select(silent, v - lif.leak * v, V_REST), psi  # from V_REST nothing leaks


@compiled_inline
def step_neuron_as_printed(lif, v, psi, theta, ceiling, current):
    """Advance a neuron, or one in each lane, as the paper prints it.

    The threshold theta compounds, and a spike needs v > theta. Arguments and results as of
    `step_neuron`, and the new theta.
    """
    v = v + current
    theta = min(theta, ceiling) + psi
    silent = v <= theta
    psi = psi + select(silent, -lif.leak * psi, lif.psi_inc)
    return silent, select(silent, v - lif.leak * v, V_REST), psi, theta


@compiled_kernel
def fire(lif, cell, row, layer, n, currents, ceilings, v, psi, trains):
    """Run a layer of n LIF neurons through a control step (paper, Eq. 1 to 3).

    A neuron's state stays in registers through its SNN steps, neurons side by side in a vector.

    Args:
        lif: the model's constants.
        cell, row, layer: whose state, and whose ceilings.
        n: neurons, a multiple of LANES.
        currents: (SNN_STEPS, widest) [mV].
        ceilings: (n_rows, n_layers, widest) of `threshold_ceilings`.
        v, psi: (n_cells, n_layers, widest) state [mV] of `step_neuron`, written.
        trains: (n_cells, n_layers, widest) spike trains, written.
    """
    for j in range(n):
        rest = min(THETA_0, ceilings[row, layer, j])
        potential, offset = v[cell, layer, j], psi[cell, layer, j]
        train = 0
        for h in range(SNN_STEPS):
            silent, potential, offset = step_neuron(lif, potential, offset, rest, currents[h, j])
            train |= 0 if silent else 1 << h
        v[cell, layer, j], psi[cell, layer, j] = potential, offset
        trains[cell, layer, j] = train


@compiled_kernel
def fire_as_printed(lif, cell, row, layer, n, currents, ceilings, v, psi, theta, trains):
    """Run a layer as the paper prints it.

    Arguments as of `fire`; theta: (n_cells, n_layers, widest) thresholds [mV], written.
    """
    for j in range(n):
        threshold = theta[cell, layer, j]
        potential, offset = v[cell, layer, j], psi[cell, layer, j]
        train = 0
        for h in range(SNN_STEPS):
            silent, potential, offset, threshold = step_neuron_as_printed(
                lif, potential, offset, threshold, ceilings[row, layer, j], currents[h, j]
            )
            train |= 0 if silent else 1 << h
        theta[cell, layer, j] = threshold
        v[cell, layer, j], psi[cell, layer, j] = potential, offset
        trains[cell, layer, j] = train


@compiled_kernel
def run_layer(
    lif, first, last, rows, layer, pre, n, synapse, weights, ceilings, currents,
    v, psi, theta, trains,
):
    """Run one layer of the cells from `first` to `last`; arguments as of `run_networks`."""
    for cell in range(first, last):
        row = rows[cell]
        if layer == 0:
            input_currents(cell, n, trains, currents)
        else:
            propagate(cell, row, layer, pre, n, weights, synapse, trains, currents)
        if lif.as_printed:
            fire_as_printed(
                lif, cell, row, layer, n, currents, ceilings, v, psi, theta, trains
            )
        else:
            fire(lif, cell, row, layer, n, currents, ceilings, v, psi, trains)


@compiled
def run_networks(
    lif, first, last, rows, sizes, weights, ceilings, currents, v, psi, theta, trains
):
    """Run the networks of some cells through one control step, without delay between layers.

    A feed-forward network may finish one layer's train before it starts the next layer.

    Args:
        first, last: the cells from `first` to, but not with, `last`.
        rows: (n_cells,) which row of weights and ceilings a cell runs.
        sizes: (n_layers,) neurons per layer.
        weights: (n_rows, ...) of `pad_synapses`.
        currents: (SNN_STEPS, widest) scratch.
        trains: (n_cells, n_layers, widest); input trains in layer 0; all leave as the layers'.
    """
    synapse = 0
    for layer in range(sizes.shape[0]):
        pre, n = sizes[max(layer - 1, 0)], (sizes[layer] + LANES - 1) // LANES * LANES
        run_layer(
            lif, first, last, rows, layer, pre, n, synapse, weights, ceilings, currents,
            v, psi, theta, trains,
        )
        synapse += pre * n if layer > 0 else 0
