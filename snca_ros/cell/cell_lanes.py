"""The cells of W robots of one shape, which step side by side, one robot in each lane.

`cells` has the cells of one robot. Both modules run networks by the same code (`spiking_layers`,
`value_layers`) and share the arithmetic of `coding`.
"""

from typing import NamedTuple

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.morphology import OPPOSITE, Morphology
from sim_node.numerics.dispatch import by_attribute
from sim_node.numerics.jit import compiled, inlined_part
from sim_node.numerics.lane_array import zeros
from sim_node.numerics.lanes import bits_of, like, load, mask_like, select, store
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.coding import (
    ACTUATION_WINDOW,
    NEVER,
    SNN_STEPS,
    actuation_of,
    next_spike,
    spike_period,
)
from snca_ros.cell.lane_faults import (
    deliver_trains,
    deliver_values,
    keep_trains,
    keep_values,
    kill,
    with_own_ages,
)
from snca_ros.cell.models.model import rounded
from snca_ros.cell.network import Network, make_network
from snca_ros.cell.spiking_layers import clear, run_spiking
from snca_ros.cell.value_layers import run_values

MAX_WIDTH = 64
"""Largest number of robots: their spikes are the bits of an integer."""


class GroupState(NamedTuple):
    """Everything that a step of n cells of W robots reads and writes.

    Each item of a lane array, (rows, fields), has W lanes. A message has, per channel, lanes of
    values or a train of SNN_STEPS masks over the robots (see `spiking_layers`).
    """

    network: Network
    n_c: int  # channels per direction
    output: int  # first item of the output layer
    neighbors: np.ndarray  # (n, 4) cells above, left, below, right; -1 where there is none
    channels: np.ndarray  # (4,) first of the n_c channels that each of them sends to the cell
    last_spike: np.ndarray  # lanes (n, n_sensors) SNN step of each reading's newest spike
    counts: np.ndarray  # lanes (n, ACTUATION_WINDOW) actuation spikes per control step
    sent_trains: np.ndarray  # (n, n_destinations * n_c, SNN_STEPS) spikes sent
    received_trains: np.ndarray  # the same one control step earlier, or more if they are late
    sent_values: np.ndarray  # lanes (n, n_destinations * n_c) values sent
    received_values: np.ndarray  # the same one control step earlier, or more if they are late
    trains: np.ndarray  # (n_items, SNN_STEPS) scratch: spikes of one cell's network, as masks


@compiled
def step_group(cells, readings, step, actuation):
    """Deliver the messages of all robots' cells and advance the cells by one control step.

    Args:
        readings: lanes (n, n_sensors) sensor readings in [0, 1].
        step: control step k, the same for all cells.
        actuation: lanes (n, 1) in [-1, 1], written.
    """
    _step_group(cells.network.model, cells, readings, step, actuation, None, 0)


@compiled
def step_group_faulty(cells, readings, step, actuation, faults, row):
    """Do what `step_group` does, with the faults in row `row` of `LaneFaults`."""
    _step_group(cells.network.model, cells, readings, step, actuation, faults, row)


@inlined_part
def _step_spiking(model, cells, readings, step, actuation, faults, row):
    if faults is None:
        n_cells, n_channels, _ = cells.sent_trains.shape
        for i in range(n_cells):
            for c in range(n_channels):
                for h in range(SNN_STEPS):
                    cells.received_trains[i, c, h] = cells.sent_trains[i, c, h]
    else:
        deliver_trains(cells.received_trains, step, faults)
    for i in range(cells.neighbors.shape[0]):
        _read_trains(model, cells, i, readings, step, faults, row)
        clear(cells.network.fired)
        run_spiking(cells.network, i, cells.trains)
        _write_trains(model, cells, i, step, actuation, faults)
        if faults is not None:
            kill(cells, i, step, actuation, faults, row)
    if faults is not None:
        keep_trains(cells.sent_trains, step, faults)


@inlined_part
def _step_values(model, cells, readings, step, actuation, faults, row):
    if faults is None:
        for i in range(cells.neighbors.shape[0]):
            for c in range(cells.sent_values.shape[1]):
                store(cells.received_values, i, c, load(cells.sent_values, i, c))
    else:
        deliver_values(cells.received_values, step, faults)
    for i in range(cells.neighbors.shape[0]):
        _read_values(model, cells, i, readings, faults, row)
        run_values(cells.network, i, None)
        _write_values(cells, i, actuation)
        if faults is not None:
            kill(cells, i, step, actuation, faults, row)
    if faults is not None:
        keep_values(cells.sent_values, step, faults)


_step_group = by_attribute(
    'spiking', {True: _step_spiking, False: _step_values},
    'Advance all cells by a control step; their networks exchange spikes or values. If `faults` is '
    'None, their code is not compiled.',
)


@inlined_part
def _read_trains(model, cells, i, readings, step, faults, row):
    n_sensors, trains, first_step = readings.shape[1], cells.trains, float(step * SNN_STEPS)
    for sensor in range(n_sensors):
        last_spike = load(cells.last_spike, i, sensor)
        period = spike_period(model, load(readings, i, sensor))
        due = next_spike(period, last_spike, first_step)
        for h in range(SNN_STEPS):
            spikes = due == like(due, first_step + h)
            trains[sensor, h] = bits_of(spikes)
            last_spike = select(spikes, due, last_spike)
            due = select(spikes, due + period, due)
        store(cells.last_spike, i, sensor, last_spike)
    for d in range(len(OPPOSITE)):
        sender, channel = cells.neighbors[i, d], cells.channels[d]
        for c in range(cells.n_c):
            for h in range(SNN_STEPS):
                train = cells.received_trains[sender, channel + c, h] if sender >= 0 else 0
                if faults is not None:
                    train &= ~faults.lost[row, i, d]
                trains[n_sensors + d * cells.n_c + c, h] = train


@inlined_part
def _write_trains(model, cells, i, step, actuation, faults):
    trains, output, age = cells.trains, cells.output, step + 1
    for c in range(cells.sent_trains.shape[1]):
        for h in range(SNN_STEPS):
            cells.sent_trains[i, c, h] = trains[output + 1 + c, h]
    n_spikes = like(load(cells.counts, i, 0), 0.0)
    for h in range(SNN_STEPS):
        spikes = mask_like(n_spikes, trains[output, h])
        n_spikes += select(spikes, 1.0, 0.0)
    store(cells.counts, i, step % ACTUATION_WINDOW, n_spikes)
    n_spikes = like(n_spikes, 0.0)
    for k in range(min(age, ACTUATION_WINDOW)):
        n_spikes += load(cells.counts, i, k)
    now = actuation_of(model, n_spikes, age)
    if faults is not None:
        now = with_own_ages(model, n_spikes, now, i, step, faults)
    store(actuation, i, 0, now)


@inlined_part
def _read_values(model, cells, i, readings, faults, row):
    n_sensors, values = readings.shape[1], cells.network.values
    for sensor in range(n_sensors):
        store(values, 0, sensor, rounded(model, load(readings, i, sensor)))
    for d in range(len(OPPOSITE)):
        sender, channel = cells.neighbors[i, d], cells.channels[d]
        for c in range(cells.n_c):
            neuron = n_sensors + d * cells.n_c + c
            if sender < 0:
                store(values, 0, neuron, 0.0)
            else:
                received = load(cells.received_values, sender, channel + c)
                if faults is not None:
                    received = select(mask_like(received, faults.lost[row, i, d]), 0.0, received)
                store(values, 0, neuron, rounded(model, received))


@inlined_part
def _write_values(cells, i, actuation):
    values, output = cells.network.values, cells.output
    for c in range(cells.sent_values.shape[1]):
        store(cells.sent_values, i, c, load(values, 0, output + 1 + c))
    store(actuation, i, 0, load(values, 0, output))


def make_cells(
    architecture: Architecture, morphology: Morphology, parameters: np.ndarray, width: int
) -> GroupState:
    """Return all cells of W robots of one shape, each robot with its own weights, before step 0.

    The cells of a robot depend only on its own weights and readings, to the bit: not on W, its
    lane or the other robots.

    Args:
        architecture: architecture of the cells.
        morphology: morphology of the robots.
        parameters: (m, n_parameters) the robots' weights, m <= W; the weights of other lanes are 0.
        width: number of lanes W.

    Raises:
        InvalidInput: `parameters` has another shape or is not finite, or W is not from 1 to
            MAX_WIDTH.
    """
    parameters = np.asarray(parameters, dtype=np.float64)
    n, n_parameters = morphology.n_voxels, architecture.n_parameters(morphology.n_voxels)
    if not 1 <= width <= MAX_WIDTH:
        raise InvalidInput('width', width, f'from 1 to {MAX_WIDTH}')
    fits = parameters.ndim == 2 and len(parameters) <= width and parameters.shape[1] == n_parameters
    if not fits or not np.isfinite(parameters).all():
        shown = f'shape {parameters.shape}, finite: {bool(np.isfinite(parameters).all())}'
        expected = f'finite numbers of shape (m, {n_parameters}), m up to {width}'
        raise InvalidInput('parameters', shown, expected)
    n_rows = 1 if architecture.uniform else n
    robots = np.zeros((width, n_rows, architecture.parameters_per_cell))
    robots[: len(parameters)] = parameters.reshape(len(parameters), n_rows, -1)
    rows = np.zeros(n, np.int64) if architecture.uniform else np.arange(n)
    network = make_network(architecture, robots, rows, lanes_are_robots=True)
    n_sent = architecture.n_destinations * architecture.n_c
    cells = GroupState(
        network=network,
        n_c=architecture.n_c,
        output=int(network.items[:-1].sum()),
        neighbors=morphology.neighbors,
        channels=np.array(OPPOSITE) * architecture.n_c * architecture.directional,
        last_spike=zeros((n, len(architecture.sensors)), width),
        counts=zeros((n, ACTUATION_WINDOW), width),
        sent_trains=np.zeros((n, n_sent, SNN_STEPS), dtype=np.int64),
        received_trains=np.zeros((n, n_sent, SNN_STEPS), dtype=np.int64),
        sent_values=zeros((n, n_sent), width),
        received_values=zeros((n, n_sent), width),
        trains=np.zeros((network.items.sum(), SNN_STEPS), dtype=np.int64),
    )
    cells.last_spike['lane'] = NEVER
    return cells
