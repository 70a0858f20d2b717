"""The state of n cells of one architecture, and one control step of a cell."""

from typing import NamedTuple

import numpy as np
from numba.cpython.unsafe.numbers import trailing_zeros

from sim_node.errors import InvalidInput
from sim_node.model.morphology import DIRECTIONS
from sim_node.numerics.dispatch import by_attribute
from sim_node.numerics.jit import compiled, inlined_part
from sim_node.numerics.lane_tuples import store_each
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.coding import (
    ACTUATION_WINDOW,
    NEVER,
    SNN_STEPS,
    decode,
    encode,
    pack_trains,
    unpack_trains,
)
from snca_ros.cell.models.model import rounded
from snca_ros.cell.network import NEURONS, WORD, Network, by_neuron, make_network
from snca_ros.cell.spiking_layers import clear, run_spiking
from snca_ros.cell.value_layers import run_values


class CellState(NamedTuple):
    """Everything that a step of n cells of one robot reads and writes.

    A message has one number per channel: a value, or a spike train as an integer (see `coding`).
    """

    network: Network
    values: np.ndarray  # (n_neurons,) the network's values, in the same memory
    last_spike: np.ndarray  # (n, n_sensors) SNN step of each reading's newest spike
    counts: np.ndarray  # (n, ACTUATION_WINDOW) actuation spikes per control step
    age: np.ndarray  # (n,) control steps since the reset
    inbox: np.ndarray  # (n, 4, n_c) messages from above, left, below, right
    outbox: np.ndarray  # (n, n_destinations, n_c) messages sent


@compiled
def reset_cells(cells, first, last):
    """Reset the state of the cells from `first` up to, not including, `last`; weights stay."""
    network = cells.network
    for i in range(first, last):
        for j in range(network.items.sum()):
            store_each(network.state, i, j, network.start)
        cells.last_spike[i] = NEVER
        cells.counts[i] = 0
        cells.age[i] = 0
        cells.inbox[i] = 0.0
        cells.outbox[i] = 0.0


@compiled
def step_cells(cells, first, last, readings, step, actuation):
    """Advance the cells from `first` up to, not including, `last` by one control step.

    It reads inbox and readings, and writes outbox and actuation. Evolution, the offline controller
    and the voxel nodes all call this function.

    Args:
        readings: (n, n_sensors) sensor readings in [0, 1].
        step: control step k, the same for all cells.
        actuation: (n,) in [-1, 1], written.
    """
    for i in range(first, last):
        _step_cell(cells.network.model, cells, i, readings, step, actuation)


@inlined_part
def _step_spiking(model, cells, i, readings, step, actuation):
    _read_trains(model, cells, i, readings, step)
    run_spiking(cells.network, i, None)
    _write_trains(model, cells, i, actuation)


@inlined_part
def _step_values(model, cells, i, readings, step, actuation):
    _read_values(model, cells, i, readings)
    run_values(cells.network, i, cells.values)
    _write_values(cells, i, actuation)


_step_cell = by_attribute(
    'spiking', {True: _step_spiking, False: _step_values},
    'Advance cell i by a control step; its network exchanges spikes or values.',
)


@inlined_part
def _read_trains(model, cells, i, readings, step):
    """Write the spikes of readings and messages into `fired`, for the input neurons."""
    fired, n_sensors, n_c = cells.network.fired, readings.shape[1], cells.inbox.shape[2]
    clear(fired)
    for sensor in range(n_sensors):
        train, cells.last_spike[i, sensor] = encode(
            model, readings[i, sensor], cells.last_spike[i, sensor], step * SNN_STEPS
        )
        _put_train(fired, sensor, train)
    for d in range(4):
        for c in range(n_c):
            _put_train(fired, n_sensors + d * n_c + c, int(cells.inbox[i, d, c]))


@inlined_part
def _put_train(fired, neuron, train):
    while train != 0:
        h = trailing_zeros(train)
        train &= train - 1
        fired[neuron // WORD, h] |= 1 << neuron % WORD


@inlined_part
def _write_trains(model, cells, i, actuation):
    fired, n_c = cells.network.fired, cells.outbox.shape[2]
    n_spikes = 0
    for h in range(SNN_STEPS):
        n_spikes += fired[0, h] & 1
    cells.counts[i, cells.age[i] % ACTUATION_WINDOW] = n_spikes
    cells.age[i] += 1
    actuation[i] = decode(model, cells.counts, i, cells.age[i])
    for d in range(cells.outbox.shape[1]):
        for c in range(n_c):
            neuron = 1 + d * n_c + c
            train = 0
            for h in range(SNN_STEPS):
                train |= (fired[neuron // WORD, h] >> neuron % WORD & 1) << h
            cells.outbox[i, d, c] = train


@inlined_part
def _read_values(model, cells, i, readings):
    n_sensors, n_c = readings.shape[1], cells.inbox.shape[2]
    for sensor in range(n_sensors):
        cells.values[sensor] = rounded(model, readings[i, sensor])
    for d in range(4):
        for c in range(n_c):
            cells.values[n_sensors + d * n_c + c] = rounded(model, cells.inbox[i, d, c])


@inlined_part
def _write_values(cells, i, actuation):
    n_c, items = cells.outbox.shape[2], cells.network.items
    output = (items.sum() - items[items.shape[0] - 1]) * NEURONS
    for d in range(cells.outbox.shape[1]):
        for c in range(n_c):
            cells.outbox[i, d, c] = cells.values[output + 1 + d * n_c + c]
    cells.age[i] += 1
    actuation[i] = cells.values[output]


class Cells:
    """n cells of one architecture, each with its own state.

    Args:
        architecture: architecture of the cells.
        weights: (n_rows, parameters_per_cell).
        rows: (n,) index of each cell's row of `weights`; None for one row per cell, in order.

    Raises:
        InvalidInput: `weights` has another shape or is not finite.
    """

    def __init__(
        self, architecture: Architecture, weights: np.ndarray, rows: np.ndarray | None = None
    ) -> None:
        weights = np.asarray(weights, dtype=np.float64)
        expected = architecture.parameters_per_cell
        if weights.ndim != 2 or weights.shape[1] != expected or not np.isfinite(weights).all():
            shown = f'shape {weights.shape}, finite: {bool(np.isfinite(weights).all())}'
            raise InvalidInput('weights', shown, f'finite numbers of shape (n, {expected})')
        self.architecture = architecture
        rows = np.arange(len(weights)) if rows is None else np.asarray(rows, dtype=np.int64)
        n = len(rows)
        network = make_network(architecture, weights[None], rows, lanes_are_robots=False)
        self.state = CellState(
            network=network,
            values=network.values.view(np.ndarray)['lane'].reshape(-1),
            last_spike=np.zeros((n, len(architecture.sensors))),
            counts=np.zeros((n, ACTUATION_WINDOW), dtype=np.int64),
            age=np.zeros(n, dtype=np.int64),
            inbox=np.zeros((n, len(DIRECTIONS), architecture.n_c)),
            outbox=np.zeros((n, architecture.n_destinations, architecture.n_c)),
        )
        self._readings, self._actuation = np.zeros((n, len(architecture.sensors))), np.zeros(n)
        self.reset()

    def reset(self) -> None:
        """Reset the state of all cells; the weights stay."""
        reset_cells(self.state, 0, len(self.state.age))

    @property
    def outbox(self) -> np.ndarray:
        """Return the spikes or values sent last, (n, n_destinations, n_c, width)."""
        sent = self.state.outbox
        return unpack_trains(sent) if self.architecture.spiking else sent[..., np.newaxis].copy()

    def variables(self, name: str) -> np.ndarray:
        """Return a state variable of all neurons, (n, n_neurons), layer after layer."""
        network = self.state.network
        array = network.state[list(self.architecture.model.state).index(name)]
        return np.concatenate(by_neuron(network, array), axis=1)

    def thresholds(self) -> np.ndarray | None:
        """Return the thresholds [mV] of all neurons but the inputs, (n, n_neurons).

        None if the neuron model has none.
        """
        network, model = self.state.network, self.architecture.model
        if not hasattr(model, 'thresholds'):
            return None
        own = [by_neuron(network, array) for array in network.own]
        state = [by_neuron(network, array) for array in network.state]
        layers = [
            model.thresholds(
                tuple(array[layer] for array in state),
                tuple(array[layer][network.rows] for array in own),
            )
            for layer in range(1, len(network.sizes))
        ]
        return np.concatenate(layers, axis=1)

    def empty_inbox(self) -> np.ndarray:
        """Return an inbox without messages: zeros of shape (4, n_c, width)."""
        return np.zeros((*self.state.inbox.shape[1:], self.architecture.message_width))

    def step_cell(self, i: int, readings: np.ndarray, inbox: np.ndarray, step: int) -> float:
        """Advance cell `i` by control step `step` and return its actuation.

        Args:
            readings: (n_sensors,) in [0, 1].
            inbox: (4, n_c, width) spikes or values from above, left, below, right.
        """
        state = self.state
        state.inbox[i] = pack_trains(inbox) if self.architecture.spiking else inbox[..., 0]
        self._readings[i] = readings
        step_cells(state, i, i + 1, self._readings, step, self._actuation)
        return float(self._actuation[i])
