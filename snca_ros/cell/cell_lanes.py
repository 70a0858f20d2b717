"""The cells of W robots of one shape that step side by side, one robot in each lane.

`cells` is one robot's; here is the same cell with a vector in the place of every number. Both
share their arithmetic: `coding`, `snn.step_neuron`, `elementary.tanh`.
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.morphology import OPPOSITE, Morphology
from sim_node.numerics.jit import compiled, inlined_part
from sim_node.numerics.lane_array import zeros
from sim_node.numerics.lanes import bits_of, like, load, mask_like, select, store
from snca_ros.cell import mlp_lanes, snn, snn_lanes
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.coding import (
    ACTUATION_WINDOW,
    NEVER,
    SNN_STEPS,
    actuation_of,
    next_spike,
    spike_period,
)
from snca_ros.cell.layers import pad_synapses, padded

MAX_WIDTH = 64
"""Robots at most: their spikes are the bits of an integer."""


class GroupState(NamedTuple):
    """Everything that a step of n cells of W robots reads and writes.

    Arrays of lanes are (rows, fields) of W each. A message is a number per channel in lanes, or a
    train of SNN_STEPS masks over the robots (see `snn_lanes`).
    """

    spiking: bool
    n_c: int  # channels per direction
    output: int  # first neuron of the output layer
    sizes: np.ndarray  # (n_layers,) neurons per layer
    rows: np.ndarray  # (n,) which row of weights and ceilings each cell runs
    neighbors: np.ndarray  # (n, 4) who is above, left, below, right; -1 for nobody
    channels: np.ndarray  # (4,) the first of the n_c channels that each of them sends here
    weights: np.ndarray  # lanes (n_rows, n_synapses), biases included
    ceilings: np.ndarray  # lanes (n_rows, n_neurons) of the thresholds at rest [mV]
    lif: snn.Lif
    v: np.ndarray  # lanes (n, n_neurons) potential [mV], which has leaked for the next step
    psi: np.ndarray  # lanes (n, n_neurons) homeostatic offset [mV]
    theta: np.ndarray | None  # lanes (n, n_neurons) threshold [mV]; None if it does not compound
    last_spike: np.ndarray  # lanes (n, n_sensors) SNN step of each reading's newest spike
    counts: np.ndarray  # lanes (n, ACTUATION_WINDOW) actuation spikes per control step
    sent_trains: np.ndarray  # (n, n_destinations * n_c, SNN_STEPS) spikes sent
    heard_trains: np.ndarray  # the same as it was a control step ago
    sent_values: np.ndarray  # lanes (n, n_destinations * n_c) values sent
    heard_values: np.ndarray  # the same as it was a control step ago
    trains: np.ndarray  # (n_neurons, SNN_STEPS) scratch: spikes of one cell's network, as masks
    heard: np.ndarray  # (n_words, SNN_STEPS) scratch: neurons of the layer before that fire
    fired: np.ndarray  # (n_words, SNN_STEPS) scratch: neurons of the layer that runs that fire
    values: np.ndarray  # lanes (1, n_neurons) scratch: activations of one cell's perceptron


@compiled
def step_group(cells, readings, step, actuation):
    """Deliver what the cells of all robots sent and advance them by one control step.

    Args:
        readings: lanes (n, n_sensors) sensor readings in [0, 1].
        step: control step k, the same for all cells.
        actuation: lanes (n, 1) in [-1, 1], written.
    """
    if cells.spiking:
        cells.heard_trains[:] = cells.sent_trains
        for i in range(cells.rows.shape[0]):
            _read_trains(cells, i, readings, step)
            snn_lanes.run_network(
                cells.lif, i, cells.rows[i], cells.sizes, cells.weights, cells.ceilings,
                cells.v, cells.psi, cells.theta, cells.trains, cells.heard, cells.fired,
            )
            _write_trains(cells, i, step, actuation)
    else:
        for i in range(cells.rows.shape[0]):
            for c in range(cells.sent_values.shape[1]):
                store(cells.heard_values, i, c, load(cells.sent_values, i, c))
        for i in range(cells.rows.shape[0]):
            _read_values(cells, i, readings)
            mlp_lanes.run_network(cells.rows[i], cells.sizes, cells.weights, cells.values)
            _write_values(cells, i, actuation)


@inlined_part
def _read_trains(cells, i, readings, step):
    n_sensors, trains, first_step = readings.shape[1], cells.trains, float(step * SNN_STEPS)
    for sensor in range(n_sensors):
        last_spike = load(cells.last_spike, i, sensor)
        period = spike_period(load(readings, i, sensor))
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
                heard = cells.heard_trains[sender, channel + c, h] if sender >= 0 else 0
                trains[n_sensors + d * cells.n_c + c, h] = heard


@inlined_part
def _write_trains(cells, i, step, actuation):
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
    store(actuation, i, 0, actuation_of(n_spikes, age))


@inlined_part
def _read_values(cells, i, readings):
    n_sensors, values = readings.shape[1], cells.values
    for sensor in range(n_sensors):
        store(values, 0, sensor, load(readings, i, sensor))
    for d in range(len(OPPOSITE)):
        sender, channel = cells.neighbors[i, d], cells.channels[d]
        for c in range(cells.n_c):
            neuron = n_sensors + d * cells.n_c + c
            if sender < 0:
                store(values, 0, neuron, 0.0)
            else:
                store(values, 0, neuron, load(cells.heard_values, sender, channel + c))


@inlined_part
def _write_values(cells, i, actuation):
    output = cells.output
    for c in range(cells.sent_values.shape[1]):
        store(cells.sent_values, i, c, load(cells.values, 0, output + 1 + c))
    store(actuation, i, 0, load(cells.values, 0, output))


def make_cells(
    architecture: Architecture, morphology: Morphology, thetas: np.ndarray, width: int
) -> GroupState:
    """Return all cells of W robots of one shape, each robot with its own weights, before step 0.

    What a robot's cells do depends on its own weights and readings alone, to the bit: neither on
    W, nor on its lane, nor on its companions.

    Args:
        architecture: what kind of cell.
        morphology: whose voxels the cells control.
        thetas: (m, n_parameters) the robots' weights, m <= W; the weights of other lanes are 0.
        width: number of lanes W.

    Raises:
        InvalidInput: `thetas` has another shape or is not finite, or W is not in 1 ... MAX_WIDTH.
    """
    thetas = np.asarray(thetas, dtype=np.float64)
    n, n_parameters = morphology.n_voxels, architecture.n_parameters(morphology.n_voxels)
    if not 1 <= width <= MAX_WIDTH:
        raise InvalidInput('width', width, f'from 1 to {MAX_WIDTH}')
    fits = thetas.ndim == 2 and len(thetas) <= width and thetas.shape[1] == n_parameters
    if not fits or not np.isfinite(thetas).all():
        shown = f'shape {thetas.shape}, finite: {bool(np.isfinite(thetas).all())}'
        expected = f'finite numbers of shape (m, {n_parameters}), m up to {width}'
        raise InvalidInput('thetas', shown, expected)
    sizes, spiking = architecture.layer_sizes, architecture.spiking
    multiple = snn_lanes.PAIR if spiking else 1
    n_rows = 1 if architecture.uniform else n
    robots = np.zeros((width, n_rows, architecture.weights_per_cell))
    robots[: len(thetas)] = thetas.reshape(len(thetas), n_rows, -1)
    neurons = [padded(size, multiple) for size in sizes]
    layout = n, sum(neurons)
    n_sent = architecture.n_destinations * architecture.n_c
    cells = GroupState(
        spiking=spiking,
        n_c=architecture.n_c,
        sizes=np.array(sizes, dtype=np.int64),
        output=sum(neurons[:-1]),
        rows=np.zeros(n, np.int64) if architecture.uniform else np.arange(n),
        neighbors=morphology.neighbors,
        channels=np.array(OPPOSITE) * architecture.n_c * architecture.directional,
        weights=_in_lanes(robots, lambda w: pad_synapses(sizes, w, not spiking, multiple)),
        ceilings=_in_lanes(robots, lambda w: _ceilings(sizes, w, architecture.homeostasis)),
        lif=snn.lif_constants(architecture.homeostasis, architecture.as_printed),
        v=zeros(layout, width),
        psi=zeros(layout, width),
        theta=zeros(layout, width) if architecture.as_printed else None,
        last_spike=zeros((n, len(architecture.sensors)), width),
        counts=zeros((n, ACTUATION_WINDOW), width),
        sent_trains=np.zeros((n, n_sent, SNN_STEPS), dtype=np.int64),
        heard_trains=np.zeros((n, n_sent, SNN_STEPS), dtype=np.int64),
        sent_values=zeros((n, n_sent), width),
        heard_values=zeros((n, n_sent), width),
        trains=np.zeros((sum(neurons), SNN_STEPS), dtype=np.int64),
        heard=np.zeros((-(-max(sizes) // snn_lanes.WORD), SNN_STEPS), dtype=np.int64),
        fired=np.zeros((-(-max(sizes) // snn_lanes.WORD), SNN_STEPS), dtype=np.int64),
        values=zeros((1, sum(neurons)), width),
    )
    cells.last_spike['lane'] = NEVER
    if cells.theta is not None:
        cells.theta['lane'] = snn.THETA_0
    return cells


def _in_lanes(robots: np.ndarray, lay_out: Callable) -> np.ndarray:
    """Return `lay_out` of each cell's weights, given (W, n_rows, ...), as lanes (n_rows, k)."""
    rows = np.array([[lay_out(weights) for weights in robot] for robot in robots])
    array = zeros(rows.shape[1:], len(robots))
    array['lane'][:] = rows.transpose(1, 2, 0)
    return array


def _ceilings(sizes: tuple[int, ...], weights: np.ndarray, homeostasis: bool) -> np.ndarray:
    """Return one cell's thresholds' ceilings [mV], a layer after the other."""
    layers = snn.threshold_ceilings(sizes, weights, homeostasis)
    widths = (padded(size, snn_lanes.PAIR) for size in sizes)
    return np.concatenate([layer[:n] for layer, n in zip(layers, widths, strict=True)])
