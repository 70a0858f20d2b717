"""Fully connected layers: the order of a cell's parameters, and padding to lanes."""

from typing import Literal, NamedTuple

import numpy as np

PAIR = 2
"""Items of a spiking layer that step alternately: each step depends on the item's previous step,
so one item computes while the other waits for its result."""


def n_parameters(sizes: tuple[int, ...], n_evolved: int) -> int:
    """Return the number of parameters of layers of these sizes.

    Args:
        sizes: neurons per layer.
        n_evolved: evolved parameters per neuron, besides its weights; input neurons have none.
    """
    return sum((a + n_evolved) * b for a, b in zip(sizes[:-1], sizes[1:], strict=True))


class Layer(NamedTuple):
    """The parameters of a layer's n neurons."""

    evolved: np.ndarray  # (n_evolved, n)
    synapses: np.ndarray  # (n_presynaptic, n) weights


def layers_of(sizes: tuple[int, ...], parameters: np.ndarray, n_evolved: int) -> list[Layer]:
    """Return the layers after the input layer.

    Args:
        sizes: neurons per layer.
        parameters: (n_parameters,) layer after layer: the neurons' evolved parameters, then the
            weights, a row per presynaptic neuron.
        n_evolved: evolved parameters per neuron.
    """
    layers, first = [], 0
    for pre, n in zip(sizes[:-1], sizes[1:], strict=True):
        middle, last = first + n_evolved * n, first + (n_evolved + pre) * n
        layers.append(Layer(
            parameters[first:middle].reshape(n_evolved, n),
            parameters[middle:last].reshape(pre, n),
        ))
        first = last
    return layers


def padded(n: int, multiple: int) -> int:
    """Return `n` rounded up to a multiple."""
    return -(-n // multiple) * multiple


def pad(
    rows: np.ndarray, multiple: int, mode: Literal['constant', 'edge'] = 'constant'
) -> np.ndarray:
    """Return (k, n) rows with n padded to a multiple, by zeros or (mode 'edge') the last value."""
    width = padded(rows.shape[1], multiple) - rows.shape[1]
    return np.pad(rows, ((0, 0), (0, width)), mode=mode)
