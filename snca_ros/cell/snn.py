"""Leaky integrate-and-fire neurons with homeostasis, in fully connected feed-forward layers."""

from typing import NamedTuple

import numpy as np

from sim_node.compiled import compiled
from snca_ros.cell.coding import SNN_RATE

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


def n_weights(sizes: tuple[int, ...]) -> int:
    """Return the number of synapses of fully connected layers of these sizes; no biases."""
    return sum(a * b for a, b in zip(sizes[:-1], sizes[1:], strict=True))


def threshold_ceilings(
    sizes: tuple[int, ...], weights: np.ndarray, homeostasis: bool
) -> np.ndarray:
    """Return (n_layers, widest) upper bounds of the thresholds at rest [mV].

    With homeostasis the sum of a neuron's incoming weights (1 for input neurons), summed in
    presynaptic order; without, no bound.
    """
    ceilings = np.full((len(sizes), max(sizes)), np.inf)
    if homeostasis:
        ceilings[0, : sizes[0]] = 1.0
        synapse = 0
        for layer, (pre, post) in enumerate(zip(sizes[:-1], sizes[1:], strict=True), start=1):
            synapses = weights[synapse : synapse + pre * post].reshape(pre, post)
            ceilings[layer, :post] = np.add.accumulate(synapses, axis=0)[-1]
            synapse += pre * post
    return ceilings


@compiled
def lif_layer(lif, layer, n, ceilings, trains, v, psi):
    """Run one layer of n LIF neurons through a train of SNN steps (paper, Eq. 1 to 3).

    theta = min(theta_0, ceiling) + psi; v <- v - lambda dt v + current; v >= theta: a spike,
    v <- v_rest, psi <- psi + psi_inc; else psi <- psi - lambda dt psi.

    Args:
        lif: the model's constants.
        layer: which row of the arrays, all (n_layers, ..., widest).
        ceilings: of `threshold_ceilings`.
        trains: (n_layers, 16, widest) the layer's input current [mV], replaced by its spikes.
        v, psi: state [mV], written.
    """
    for h in range(trains.shape[1]):
        for j in range(n):
            threshold = min(THETA_0, ceilings[layer, j]) + psi[layer, j]
            potential = v[layer, j] - lif.leak * v[layer, j] + trains[layer, h, j]
            offset = psi[layer, j]
            fired = potential >= threshold
            v[layer, j] = V_REST if fired else potential
            psi[layer, j] = offset + lif.psi_inc if fired else offset - lif.leak * offset
            trains[layer, h, j] = 1.0 if fired else 0.0


@compiled
def lif_layer_as_printed(lif, layer, n, ceilings, trains, v, psi, theta):
    """Run one layer as the paper prints it: the threshold compounds, a spike needs v > theta.

    Arguments as of `lif_layer`; theta: (n_layers, widest) the thresholds [mV], written.
    """
    for h in range(trains.shape[1]):
        for j in range(n):
            theta[layer, j] = min(theta[layer, j], ceilings[layer, j]) + psi[layer, j]
            potential = v[layer, j] - lif.leak * v[layer, j] + trains[layer, h, j]
            if potential > theta[layer, j]:
                v[layer, j] = V_REST
                psi[layer, j] += lif.psi_inc
                trains[layer, h, j] = 1.0
            else:
                v[layer, j] = potential
                psi[layer, j] -= lif.leak * psi[layer, j]
                trains[layer, h, j] = 0.0


@compiled
def propagate(layer, pre, post, weights, first_synapse, trains):
    """Write the currents [mV] into `layer`: the weights of all synapses that carry a spike."""
    for h in range(trains.shape[1]):
        for j in range(post):
            trains[layer, h, j] = 0.0
        for i in range(pre):
            if trains[layer - 1, h, i] > 0.0:
                row = first_synapse + i * post
                for j in range(post):
                    trains[layer, h, j] += weights[row + j]


@compiled
def run_network(lif, sizes, weights, ceilings, trains, v, psi, theta):
    """Run all layers through one control step of SNN steps, without delay between layers.

    A feed-forward network may finish one layer's train before it starts the next layer.

    Args:
        sizes: (n_layers,) neurons per layer.
        weights: synapses layer by layer, presynaptic index slow.
        trains: (n_layers, 16, widest) row 0 holds the input spikes; all rows leave as spikes.
    """
    synapse = 0
    for layer in range(sizes.shape[0]):
        n = sizes[layer]
        if layer > 0:
            pre = sizes[layer - 1]
            propagate(layer, pre, n, weights, synapse, trains)
            synapse += pre * n
        if lif.as_printed:
            lif_layer_as_printed(lif, layer, n, ceilings, trains, v, psi, theta)
        else:
            lif_layer(lif, layer, n, ceilings, trains, v, psi)
