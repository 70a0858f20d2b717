"""Fully connected layers, laid out so that loops over a layer's neurons fill whole vectors."""

import numpy as np

LANES = 8
"""Rows of neurons are padded to a multiple of this; padding has no weight and never fires."""


def padded(n: int, multiple: int = LANES) -> int:
    """Return `n` neurons rounded up to a multiple, by default to whole vectors."""
    return -(-n // multiple) * multiple


def n_synapses(sizes: tuple[int, ...], bias: bool) -> int:
    """Return the number of weights, and biases if any, of layers of these sizes."""
    return sum((a + bias) * b for a, b in zip(sizes[:-1], sizes[1:], strict=True))


def synapses_by_layer(
    sizes: tuple[int, ...], weights: np.ndarray, bias: bool
) -> list[np.ndarray]:
    """Return each layer's (presynaptic neurons, neurons) weights; a bias row comes first."""
    layers, first = [], 0
    for pre, post in zip(sizes[:-1], sizes[1:], strict=True):
        last = first + (pre + bias) * post
        layers.append(weights[first:last].reshape(pre + bias, post))
        first = last
    return layers


def pad_synapses(
    sizes: tuple[int, ...], weights: np.ndarray, bias: bool, multiple: int = LANES
) -> np.ndarray:
    """Return `weights`, layer by layer, presynaptic index slow, with every row padded by zeros."""
    rows = [
        np.pad(w, ((0, 0), (0, padded(w.shape[1], multiple) - w.shape[1])))
        for w in synapses_by_layer(sizes, weights, bias)
    ]
    return np.concatenate([row.ravel() for row in rows])
