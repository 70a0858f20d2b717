"""Cells that step: the state of n cells of one architecture, and one control step of a cell."""

from typing import NamedTuple

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.morphology import DIRECTIONS
from sim_node.numerics.jit import compiled, inlined_part
from snca_ros.cell import mlp, snn
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.coding import (
    ACTUATION_WINDOW,
    NEVER,
    SNN_STEPS,
    count_spikes,
    decode,
    encode,
    pack_trains,
    unpack_trains,
)
from snca_ros.cell.layers import pad_synapses, padded


class CellState(NamedTuple):
    """Everything that a step of n cells reads and writes; W is the widest layer's padded size.

    A message holds one number per channel: a value, or a spike train as the integer that it is.
    """

    spiking: bool
    sizes: np.ndarray  # (n_layers,) neurons per layer
    rows: np.ndarray  # (n,) which row of weights and ceilings each cell runs
    weights: np.ndarray  # (n_rows, ...) with rows of synapses padded
    ceilings: np.ndarray  # (n_rows, n_layers, W) of the thresholds at rest [mV]
    lif: snn.Lif
    v: np.ndarray  # (n, n_layers, W) potential [mV], which has leaked for the next step
    psi: np.ndarray  # (n, n_layers, W) homeostatic offset [mV]
    theta: np.ndarray  # (n, n_layers, W) threshold [mV], where it compounds
    last_spike: np.ndarray  # (n, n_sensors) SNN step of the newest spike that encodes each reading
    counts: np.ndarray  # (n, ACTUATION_WINDOW) actuation spikes per control step
    age: np.ndarray  # (n,) control steps made
    inbox: np.ndarray  # (n, 4, n_c) messages from above, left, below, right
    outbox: np.ndarray  # (n, n_destinations, n_c) messages sent
    trains: np.ndarray  # (n, n_layers, W) spike trains of all neurons
    currents: np.ndarray  # (SNN_STEPS, W) scratch: of one layer's neurons [mV]
    values: np.ndarray  # (n, n_layers, W) activations of all neurons


@compiled
def reset_cells(cells, first, last):
    """Let the cells from `first` to `last` forget everything but their weights."""
    for i in range(first, last):
        cells.v[i] = 0.0
        cells.psi[i] = 0.0
        cells.theta[i] = snn.THETA_0
        cells.last_spike[i] = NEVER
        cells.counts[i] = 0
        cells.age[i] = 0
        cells.inbox[i] = 0.0
        cells.outbox[i] = 0.0


@compiled
def step_cells(cells, first, last, readings, step, actuation):
    """Advance the cells from `first` to `last` by one control step.

    Inbox and readings in, outbox and actuation out. This one function is what evolution, the
    offline controller and the voxel nodes step.

    Args:
        readings: (n, n_sensors) sensor readings in [0, 1].
        step: control step k, the same for all cells.
        actuation: (n,) in [-1, 1], written.
    """
    if cells.spiking:
        _read_trains(cells, first, last, readings, step)
        snn.run_networks(
            cells.lif, first, last, cells.rows, cells.sizes, cells.weights, cells.ceilings,
            cells.currents, cells.v, cells.psi, cells.theta, cells.trains,
        )
        _write_trains(cells, first, last, actuation)
    else:
        _read_values(cells, first, last, readings)
        mlp.run_networks(first, last, cells.rows, cells.sizes, cells.weights, cells.values)
        _write_values(cells, first, last, actuation)


@inlined_part
def _read_trains(cells, first, last, readings, step):
    n_sensors, n_c = readings.shape[1], cells.inbox.shape[2]
    for i in range(first, last):
        for sensor in range(n_sensors):
            cells.trains[i, 0, sensor], cells.last_spike[i, sensor] = encode(
                readings[i, sensor], cells.last_spike[i, sensor], step * SNN_STEPS
            )
        for d in range(4):
            for c in range(n_c):
                cells.trains[i, 0, n_sensors + d * n_c + c] = int(cells.inbox[i, d, c])


@inlined_part
def _write_trains(cells, first, last, actuation):
    n_c, output = cells.outbox.shape[2], cells.trains.shape[1] - 1
    for i in range(first, last):
        for d in range(cells.outbox.shape[1]):
            for c in range(n_c):
                cells.outbox[i, d, c] = cells.trains[i, output, 1 + d * n_c + c]
        n_spikes = count_spikes(cells.trains[i, output, 0])
        cells.counts[i, cells.age[i] % ACTUATION_WINDOW] = n_spikes
        cells.age[i] += 1
        actuation[i] = decode(cells.counts, i, cells.age[i])


@inlined_part
def _read_values(cells, first, last, readings):
    n_sensors, n_c = readings.shape[1], cells.inbox.shape[2]
    for i in range(first, last):
        for sensor in range(n_sensors):
            cells.values[i, 0, sensor] = readings[i, sensor]
        for d in range(4):
            for c in range(n_c):
                cells.values[i, 0, n_sensors + d * n_c + c] = cells.inbox[i, d, c]


@inlined_part
def _write_values(cells, first, last, actuation):
    n_c, output = cells.outbox.shape[2], cells.values.shape[1] - 1
    for i in range(first, last):
        for d in range(cells.outbox.shape[1]):
            for c in range(n_c):
                cells.outbox[i, d, c] = cells.values[i, output, 1 + d * n_c + c]
        cells.age[i] += 1
        actuation[i] = cells.values[i, output, 0]


class Cells:
    """n cells of one architecture, each with its own state.

    Args:
        architecture: what kind of cell.
        weights: (n_rows, weights_per_cell).
        rows: (n,) which row of `weights` each cell runs; None for a row per cell.

    Raises:
        InvalidInput: `weights` has another shape or is not finite.
    """

    def __init__(
        self, architecture: Architecture, weights: np.ndarray, rows: np.ndarray | None = None
    ) -> None:
        weights = np.asarray(weights, dtype=np.float64)
        expected = architecture.weights_per_cell
        if weights.ndim != 2 or weights.shape[1] != expected or not np.isfinite(weights).all():
            shown = f'shape {weights.shape}, finite: {bool(np.isfinite(weights).all())}'
            raise InvalidInput('weights', shown, f'finite numbers of shape (n, {expected})')
        self.architecture = architecture
        rows = np.arange(len(weights)) if rows is None else np.asarray(rows, dtype=np.int64)
        n, sizes, spiking = len(rows), architecture.layer_sizes, architecture.spiking
        layers = (len(sizes), padded(max(sizes)))
        self.state = CellState(
            spiking=spiking,
            sizes=np.array(sizes, dtype=np.int64),
            rows=rows,
            weights=np.stack([pad_synapses(sizes, w, bias=not spiking) for w in weights]),
            ceilings=np.array(
                [snn.threshold_ceilings(sizes, w, architecture.homeostasis) for w in weights]
                if spiking
                else np.zeros((len(weights), *layers))
            ),
            lif=snn.lif_constants(architecture.homeostasis, architecture.as_printed),
            v=np.zeros((n, *layers)),
            psi=np.zeros((n, *layers)),
            theta=np.zeros((n, *layers)),
            last_spike=np.zeros((n, len(architecture.sensors))),
            counts=np.zeros((n, ACTUATION_WINDOW), dtype=np.int64),
            age=np.zeros(n, dtype=np.int64),
            inbox=np.zeros((n, len(DIRECTIONS), architecture.n_c)),
            outbox=np.zeros((n, architecture.n_destinations, architecture.n_c)),
            trains=np.zeros((n, *layers), dtype=np.int64),
            currents=np.zeros((SNN_STEPS, layers[1])),
            values=np.zeros((n, *layers)),
        )
        self._readings, self._actuation = np.zeros((n, len(architecture.sensors))), np.zeros(n)
        self.reset()

    def reset(self) -> None:
        """Forget everything but the weights."""
        reset_cells(self.state, 0, len(self.state.rows))

    @property
    def outbox(self) -> np.ndarray:
        """Return the (n, n_destinations, n_c, width) spikes or values sent last."""
        sent = self.state.outbox
        return unpack_trains(sent) if self.state.spiking else sent[..., np.newaxis].copy()

    def silence(self) -> np.ndarray:
        """Return an inbox, (4, n_c, width), in which nothing was said."""
        return np.zeros((*self.state.inbox.shape[1:], self.architecture.message_width))

    def step_cell(self, i: int, readings: np.ndarray, inbox: np.ndarray, step: int) -> float:
        """Advance cell `i` by control step `step` and return its actuation.

        Args:
            readings: (4,) in [0, 1].
            inbox: (4, n_c, width) spikes or values from above, left, below, right.
        """
        state = self.state
        state.inbox[i] = pack_trains(inbox) if state.spiking else inbox[..., 0]
        self._readings[i] = readings
        step_cells(state, i, i + 1, self._readings, step, self._actuation)
        return float(self._actuation[i])
