"""The neurons of n cells as lane arrays, whose lanes are neurons or robots.

In the networks of one robot, the lanes are eight neurons of a layer; in those of W robots, they are
the same neuron of W robots. The same code (`spiking_layers`, `value_layers`) steps both. An item is
an element of a lane array: eight neurons, or one neuron of W robots.
"""

from typing import Any, NamedTuple

import numpy as np

from sim_node.numerics.lane_array import LaneArray, zeros
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.coding import SNN_STEPS
from snca_ros.cell.layers import PAIR, Layer, layers_of, pad, padded
from snca_ros.cell.models.model import quantised

NEURONS = 8
"""Neurons per item in the networks of one robot."""

WORD = 64
"""Neurons per word of `Network.fired`: bit i of word w is neuron 64 w + i of a layer."""


class Network(NamedTuple):
    """The neurons of n cells, layer after layer, each padded to whole items or pairs of items."""

    model: Any  # constants of the neuron model, whose type selects compiled code
    sizes: np.ndarray  # (n_layers,) neurons per layer
    items: np.ndarray  # (n_layers,) items per layer
    rows: np.ndarray  # (n,) index of each cell's row of `weights` and `own`
    weights: LaneArray  # (n_rows, n_synapses); a layer has a row per presynaptic neuron
    own: tuple[LaneArray, ...]  # (n_rows, n_items) each: constants of each neuron
    state: tuple[LaneArray, ...]  # (n, n_items) each: variables of each neuron
    start: tuple[float, ...]  # their values at reset
    presynaptic: np.ndarray  # (n_words, SNN_STEPS) scratch: neurons of the last layer that fire
    fired: np.ndarray  # (n_words, SNN_STEPS) scratch: neurons of the current layer that fire
    values: LaneArray  # (1, n_items) scratch: values of one cell's neurons


def make_network(
    architecture: Architecture, parameters: np.ndarray, rows: np.ndarray, lanes_are_robots: bool
) -> Network:
    """Return the networks of n cells, in the state after a reset.

    Args:
        architecture: architecture of the cells.
        parameters: (W, n_rows, parameters_per_cell), W = 1 if lanes are neurons.
        rows: (n,) index of each cell's row of `parameters`.
        lanes_are_robots: whether the lanes are W robots, or neurons of one robot.
    """
    model, sizes = architecture.model, architecture.layer_sizes
    neurons = 1 if lanes_are_robots else NEURONS
    multiple = neurons * (PAIR if model.spiking else 1)
    width = len(parameters) if lanes_are_robots else NEURONS
    cells = [[_CellArrays(architecture, row, multiple) for row in robot] for robot in parameters]

    def lay_out(arrays: list[list[np.ndarray]]) -> LaneArray:
        flat = np.array(arrays)  # (W, n_rows, n_items * neurons)
        n_rows = flat.shape[1]
        if lanes_are_robots:
            flat = flat.transpose(1, 2, 0)
        found = zeros((n_rows, flat.size // (n_rows * width)), width)
        found['lane'][:] = flat.reshape(*found.shape, width)
        return found

    items = [padded(size, multiple) // neurons for size in sizes]
    n_own = len(cells[0][0].own)
    shape = len(rows), sum(items)
    words = -(-max(padded(size, multiple) for size in sizes) // WORD)
    network = Network(
        model=model,
        sizes=np.array(sizes, dtype=np.int64),
        items=np.array(items, dtype=np.int64),
        rows=rows,
        weights=lay_out([[cell.weights for cell in robot] for robot in cells]),
        own=tuple(lay_out([[cell.own[i] for cell in robot] for robot in cells])
                  for i in range(n_own)),
        state=tuple(zeros(shape, width) for _ in model.state),
        start=tuple(model.state.values()),
        presynaptic=np.zeros((words, SNN_STEPS), dtype=np.int64),
        fired=np.zeros((words, SNN_STEPS), dtype=np.int64),
        values=zeros((1, sum(items)), width),
    )
    for array, value in zip(network.state, network.start, strict=True):
        array['lane'] = value
    return network


class _CellArrays:
    """The weights and neuron constants of one cell, padded, layer after layer."""

    def __init__(self, architecture: Architecture, parameters: np.ndarray, multiple: int) -> None:
        model, sizes = architecture.model, architecture.layer_sizes
        n = sizes[0]
        defaults = np.array([*model.evolved.values()])[:, None]
        inputs = Layer(np.tile(defaults, (1, n)), np.ones((1, n)))
        layers = [
            layer._replace(synapses=quantised(model, layer.synapses))
            for layer in layers_of(sizes, parameters, len(model.evolved))
        ]
        self.weights = np.concatenate([pad(layer.synapses, multiple).ravel() for layer in layers])
        own = [
            model.neuron_constants(layer.synapses, layer.evolved)
            for layer in (inputs, *layers)
        ]
        self.own = [
            np.concatenate([pad(c[None], multiple, 'edge').ravel() for c in of_layers])
            for of_layers in zip(*own, strict=True)
        ]


def by_neuron(network: Network, array: LaneArray) -> list[np.ndarray]:
    """Return each layer's (n, size) part of a neuron array, for the networks of one robot."""
    found, first = [], 0
    for size, items in zip(network.sizes, network.items, strict=True):
        lanes = array['lane'][:, first : first + items]
        found.append(lanes.reshape(len(lanes), -1)[:, :size])
        first += items
    return found
