"""Counts the operations of a walk's cells, and their energy by published figures.

Figures are those of a 45 nm process (Horowitz, "Computing's energy problem", ISSCC 2014). They are
of the arithmetic alone, without memory, communication and static power.
"""

from dataclasses import dataclass

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.model.morphology import OPPOSITE, Morphology
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.coding import NEVER, SNN_STEPS, encode
from snca_ros.cell.layers import layers_of
from snca_ros.cell.models.lif import Lif
from snca_ros.cell.models.perceptron import Perceptron
from snca_ros.trained_controller import TrainedController

ADD, MULTIPLY, INTEGER_ADD = 0.9, 3.7, 0.1
"""Energy of an addition and a multiplication in single precision, and of an addition of integers of
32 bits [pJ]."""

_LIF_ADDITIONS, _LIF_MULTIPLICATIONS, _LIF_INTEGER_ADDITIONS = 5, 2, 14  # per update, as in the C
_TANH_ADDITIONS, _TANH_MULTIPLICATIONS = 13, 13  # as in the C, with bias, the division among them


@dataclass(frozen=True)
class Operations:
    """Operations of one cell per control step; means over the voxels and steps of a walk.

    Attributes:
        spiking: whether the neurons spike.
        n_neurons, n_synapses: sizes of the network; input neurons have no synapses.
        spikes: spikes of all neurons; 0 if they do not spike.
        additions: weights added because of a spike.
    """

    spiking: bool
    n_neurons: int
    n_synapses: int
    spikes: float = 0.0
    additions: float = 0.0

    @property
    def updates(self) -> int:
        """Return the number of updates of neurons."""
        return self.n_neurons * (SNN_STEPS if self.spiking else 1)

    @property
    def macs(self) -> int:
        """Return the number of multiplications of a weight and a value, each with an addition."""
        return 0 if self.spiking else self.n_synapses

    def synapse_energy(self, integer: bool = False) -> float:
        """Return the energy of the synapses [pJ], in single precision or in integers."""
        if not self.spiking:
            return self.macs * (ADD + MULTIPLY)
        return self.additions * (INTEGER_ADD if integer else ADD)

    def neuron_energy(self, integer: bool = False) -> float:
        """Return the energy of the neurons [pJ], in single precision or in integers."""
        if not self.spiking:
            return self.updates * (_TANH_ADDITIONS * ADD + _TANH_MULTIPLICATIONS * MULTIPLY)
        if integer:
            return self.updates * _LIF_INTEGER_ADDITIONS * INTEGER_ADD
        return self.updates * (_LIF_ADDITIONS * ADD + _LIF_MULTIPLICATIONS * MULTIPLY)


def per_metre(energy: float, n_voxels: int, velocity: float) -> float:
    """Return the energy of a robot per metre [nJ].

    Args:
        energy: of one cell per control step [pJ].
        n_voxels: number of cells.
        velocity: of the robot [m/s].
    """
    return energy * n_voxels * CONTROL_RATE / velocity / 1000.0


def energy_lines(operations: Operations, n_voxels: int, velocity: float) -> list[str]:
    """Return operations and energy as lines of a report; see `per_metre` for the arguments."""
    o = operations
    if o.spiking:
        work = (
            f'{o.additions:.0f} additions of a weight ({o.additions / (16 * o.n_synapses):.1%} of '
            f'{16 * o.n_synapses}), {o.spikes:.0f} spikes, {o.updates} updates of neurons'
        )
    else:
        work = f'{o.macs} multiplications of a weight and a value, {o.updates} tanh'
    lines = ['', f'a cell, per control step: {work}']
    for kind, integer in (('single precision', False), ('integers', True))[: 1 + o.spiking]:
        synapses, neurons = o.synapse_energy(integer), o.neuron_energy(integer)
        in_all = per_metre(synapses + neurons, n_voxels, velocity)
        lines.append(
            f'arithmetic per metre: {per_metre(synapses, n_voxels, velocity):.3g} nJ of synapses, '
            f'{in_all:.3g} nJ with neurons, in {kind}'
        )
    return lines if velocity > 0.0 else lines[:2]


def count_operations(
    trained: TrainedController, readings: np.ndarray, spikes: np.ndarray | None
) -> Operations | None:
    """Count the operations of the cells in a recorded walk.

    Args:
        trained: the controller of the walk.
        readings: (n_steps or more, n_voxels, n_sensors) in [0, 1]; the count ends at the first
            step at which one is not known (NaN).
        spikes: (n_steps, n_voxels, n_channels, 16) that the cells sent; None if they send none.

    Returns:
        The operations; None for another neuron model than mlp, snn and snn-h.
    """
    cell = trained.architecture
    n_neurons = sum(cell.layer_sizes)
    n_synapses = sum(a * b for a, b in zip(cell.layer_sizes, cell.layer_sizes[1:], strict=False))
    if isinstance(cell.model, Perceptron):
        return Operations(False, n_neurons, n_synapses)
    if type(cell.model) is not Lif or spikes is None:
        return None
    known = np.isfinite(readings[: len(spikes)]).all(axis=(1, 2))
    n_steps = len(known) if known.all() else int(known.argmin())
    if n_steps == 0:
        return None
    counts = _spikes_of_layers(trained, readings, spikes[:n_steps])
    fan_out = (*cell.layer_sizes[1:], 0)
    additions = sum(n * targets for n, targets in zip(counts, fan_out, strict=True))
    return Operations(True, n_neurons, n_synapses, sum(counts), additions)


def _spikes_of_layers(
    trained: TrainedController, readings: np.ndarray, spikes: np.ndarray
) -> list[float]:
    """Return the mean number of spikes of each layer per cell and control step.

    The neurons inside of the cells are not recorded, so the network runs again on what it received.
    """
    cell, n_steps, n_voxels = trained.architecture, len(spikes), spikes.shape[1]
    assert isinstance(cell.model, Lif)
    layers = _LifLayers(cell, trained.parameters, n_voxels)
    last_spike = np.full((n_voxels, len(cell.sensors)), NEVER)
    heard = np.zeros((n_voxels, len(OPPOSITE) * cell.n_c, SNN_STEPS))
    sensed = np.zeros((n_voxels, len(cell.sensors), SNN_STEPS))
    for k in range(n_steps):
        for i in range(n_voxels):
            for s, reading in enumerate(readings[k, i]):
                train, last_spike[i, s] = encode(
                    cell.model, reading, last_spike[i, s], k * SNN_STEPS
                )
                sensed[i, s] = [train >> h & 1 for h in range(SNN_STEPS)]
        if k > 0:
            heard = received(cell, trained.morphology, spikes[k - 1]).reshape(heard.shape)
        layers.step(np.concatenate([sensed, heard], axis=1))
    return [count / (n_steps * n_voxels) for count in layers.counts]


def received(cell: Architecture, morphology: Morphology, sent: np.ndarray) -> np.ndarray:
    """Return what all cells receive of what they have sent in the control step before.

    Args:
        cell: architecture of the cells.
        morphology: morphology of the robot.
        sent: (n, n_channels, width) spikes or values, or (n, n_channels) values.

    Returns:
        (n, 4, n_c, width) from above, left, below, right; 0 where there is no neighbour.
    """
    messages = sent.reshape(len(sent), cell.n_destinations, cell.n_c, cell.message_width)
    found = np.zeros((len(sent), len(OPPOSITE), *messages.shape[2:]))
    for d, opposite in enumerate(OPPOSITE):
        there = morphology.neighbors[:, d] >= 0
        side = opposite if cell.directional else 0
        found[there, d] = messages[morphology.neighbors[there, d], side]
    return found


class _LifLayers:
    """The LIF networks of all cells of a robot.

    Attributes:
        counts: spikes of each layer so far.
    """

    def __init__(self, cell: Architecture, parameters: np.ndarray, n_voxels: int) -> None:
        model, sizes = cell.model, cell.layer_sizes
        assert isinstance(model, Lif)
        self._model: Lif = model
        rows = parameters.reshape(-1, cell.parameters_per_cell)
        of_rows = [[layer.synapses for layer in layers_of(sizes, row, 0)] for row in rows]
        self._weights: list[np.ndarray] = [np.stack(one) for one in zip(*of_rows, strict=True)]
        inputs = np.ones((1, sizes[0]))
        self._thresholds: list[np.ndarray] = [model.neuron_constants(inputs, inputs[:0])[0]] + [
            np.stack([model.neuron_constants(one, one[:0])[0] for one in of_layer])
            for of_layer in self._weights
        ]
        self._v: list[np.ndarray] = [np.zeros((n_voxels, n)) for n in sizes]
        self._psi: list[np.ndarray] = [np.zeros((n_voxels, n)) for n in sizes]
        self.counts: list[float] = [0.0] * len(sizes)

    def step(self, trains: np.ndarray) -> None:
        """Advance all networks by one control step; (n, n_inputs, 16) spikes arrive."""
        currents = trains.swapaxes(1, 2)  # (n, 16, n_inputs)
        for layer in range(len(self._v)):
            fired = self._run(layer, currents)
            self.counts[layer] += float(fired.sum())
            if layer < len(self._weights):
                currents = fired @ self._weights[layer]

    def _run(self, layer: int, currents: np.ndarray) -> np.ndarray:
        model, v, psi = self._model, self._v[layer], self._psi[layer]
        fired = np.empty(currents.shape)
        for h in range(SNN_STEPS):
            v += currents[:, h]
            spike = v >= self._thresholds[layer] + psi
            psi += np.where(spike, model.psi_inc, -model.leak * psi)
            v -= model.leak * v
            v[spike] = model.v_rest
            fired[:, h] = spike
        return fired
