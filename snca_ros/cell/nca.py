"""The embodied neural cellular automaton: architectures of cells, and cells that step."""

from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np

from sim_node.compiled import compiled
from sim_node.errors import InvalidInput, check_keys, near_miss
from sim_node.morphology import DIRECTIONS
from sim_node.sensors import N_SENSORS
from snca_ros.cell import mlp, snn
from snca_ros.cell.coding import ACTUATION_WINDOW, NEVER, SNN_STEPS, decode, encode

NEURON_MODELS = ('mlp', 'snn', 'snn-h')
"""Perceptron, spiking network, spiking network with homeostasis."""

ARCHITECTURES = ('U-nD', 'U-D', 'nU-D', 'nU-nD')
"""Uniform or not (U, nU) and directional or not (D, nD); the paper studies the first three."""

_MAX_N_C, _MAX_HIDDEN, _MAX_LAYERS = 64, 1024, 8


@dataclass(frozen=True)
class Architecture:
    """What kind of cell a robot has.

    Attributes:
        uniform: all voxels share one set of weights.
        directional: a cell sends a message of its own to each side, else the same to all.
        neuron_model: one of `NEURON_MODELS`.
        n_c: message channels per direction; None for the paper's 4 (nD) or 1 (D).
        hidden: sizes of the hidden layers; None for the paper's one, as wide as the input.
        as_printed: follow the paper's printed equations where the authors' code differs.

    Raises:
        InvalidInput: a value is not of this kind or out of range.
    """

    uniform: bool
    directional: bool
    neuron_model: str
    n_c: int = None  # type: ignore[assignment]  # filled in below
    hidden: tuple[int, ...] = None  # type: ignore[assignment]
    as_printed: bool = False

    def __post_init__(self) -> None:
        for name in ('uniform', 'directional', 'as_printed'):
            if not isinstance(getattr(self, name), bool):
                raise InvalidInput(name, getattr(self, name), 'true or false')
        if self.neuron_model not in NEURON_MODELS:
            expected = f'one of {", ".join(NEURON_MODELS)}'
            hint = near_miss(str(self.neuron_model), NEURON_MODELS)
            raise InvalidInput('neuron_model', self.neuron_model, expected + hint)
        if self.n_c is None:
            object.__setattr__(self, 'n_c', 1 if self.directional else 4)
        if not _is_size(self.n_c, _MAX_N_C):
            raise InvalidInput('n_c', self.n_c, f'an integer from 1 to {_MAX_N_C}')
        if self.hidden is None:
            object.__setattr__(self, 'hidden', (self.n_inputs,))
        is_list = isinstance(self.hidden, (tuple, list)) and len(self.hidden) <= _MAX_LAYERS
        if not is_list or not all(_is_size(h, _MAX_HIDDEN) for h in self.hidden):
            expected = f'up to {_MAX_LAYERS} layer sizes from 1 to {_MAX_HIDDEN}'
            raise InvalidInput('hidden', self.hidden, expected)
        object.__setattr__(self, 'hidden', tuple(self.hidden))

    @classmethod
    def named(cls, name: str, neuron_model: str, **options) -> 'Architecture':
        """Return the architecture called `name` in the paper's shorthand, such as 'U-nD'."""
        if name not in ARCHITECTURES:
            expected = f'one of {", ".join(ARCHITECTURES)}' + near_miss(str(name), ARCHITECTURES)
            raise InvalidInput('architecture', name, expected)
        uniform, directional = name.split('-')
        return cls(uniform == 'U', directional == 'D', neuron_model, **options)

    @property
    def name(self) -> str:
        """Return the paper's shorthand, such as 'U-nD'."""
        return f'{"U" if self.uniform else "nU"}-{"D" if self.directional else "nD"}'

    @property
    def spiking(self) -> bool:
        """Tell whether cells exchange spike trains rather than values."""
        return self.neuron_model != 'mlp'

    @property
    def homeostasis(self) -> bool:
        """Tell whether the neurons regulate their thresholds."""
        return self.neuron_model == 'snn-h'

    @property
    def message_width(self) -> int:
        """Return the numbers per channel in a message: a train of 16 spikes, or one value."""
        return SNN_STEPS if self.spiking else 1

    @property
    def n_destinations(self) -> int:
        """Return how many different messages a cell sends: 4, or 1 if not directional."""
        return len(DIRECTIONS) if self.directional else 1

    @property
    def n_inputs(self) -> int:
        """Return the inputs of a cell: 4 readings and n_c channels from each side."""
        return N_SENSORS + len(DIRECTIONS) * self.n_c

    @property
    def n_outputs(self) -> int:
        """Return the outputs of a cell: the actuation and the channels that it sends."""
        return 1 + self.n_destinations * self.n_c

    @property
    def layer_sizes(self) -> tuple[int, ...]:
        """Return the neurons per layer, from input to output."""
        return self.n_inputs, *self.hidden, self.n_outputs

    @property
    def weights_per_cell(self) -> int:
        """Return the number of parameters of one cell."""
        return (snn if self.spiking else mlp).n_weights(self.layer_sizes)

    def n_parameters(self, n_voxels: int) -> int:
        """Return the number of evolved parameters of a robot of `n_voxels` voxels."""
        return self.weights_per_cell * (1 if self.uniform else n_voxels)

    def to_dict(self) -> dict:
        """Return the attributes as plain numbers, texts and lists."""
        return {**asdict(self), 'hidden': list(self.hidden)}

    @classmethod
    def from_dict(cls, values: dict) -> 'Architecture':
        """Return the architecture of `to_dict`; InvalidInput if a key or value is off."""
        check_keys('architecture', values, list(cls.__dataclass_fields__))
        for key in ('uniform', 'directional', 'neuron_model'):
            if key not in values:
                raise InvalidInput(f'architecture.{key}', None, 'a value')
        return cls(**values)


def _is_size(value: object, high: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= high


class CellState(NamedTuple):
    """Everything that a step of n cells reads and writes; W is the widest layer's size."""

    spiking: bool
    sizes: np.ndarray  # (n_layers,) neurons per layer
    weights: np.ndarray  # (n, weights_per_cell)
    ceilings: np.ndarray  # (n, n_layers, W) of the thresholds at rest [mV]
    lif: snn.Lif
    v: np.ndarray  # (n, n_layers, W) potential [mV]
    psi: np.ndarray  # (n, n_layers, W) homeostatic offset [mV]
    theta: np.ndarray  # (n, n_layers, W) threshold [mV], where it compounds
    last_spike: np.ndarray  # (n, 4) SNN step of the newest spike that encodes each reading
    counts: np.ndarray  # (n, ACTUATION_WINDOW) actuation spikes per control step
    age: np.ndarray  # (n,) control steps made
    inbox: np.ndarray  # (n, 4, n_c, width) messages from above, left, below, right
    outbox: np.ndarray  # (n, n_destinations, n_c, width) messages sent
    activity: np.ndarray  # (n_layers, width, W) scratch: spikes or values of all neurons


@compiled
def step_cell(cells, i, readings, step):
    """Advance cell `i` by one control step: inbox and readings in, outbox and actuation out.

    This one function is what evolution, the offline controller and the voxel nodes step.

    Args:
        readings: (4,) sensor readings in [0, 1].
        step: control step k, the same for all cells.

    Returns:
        The actuation in [-1, 1].
    """
    if cells.spiking:
        return _step_spiking(cells, i, readings, step)
    return _step_mlp(cells, i, readings)


@compiled
def _step_spiking(cells, i, readings, step):
    n_c, width = cells.inbox.shape[2], cells.inbox.shape[3]
    trains = cells.activity
    for sensor in range(N_SENSORS):
        cells.last_spike[i, sensor] = encode(
            readings[sensor], cells.last_spike[i, sensor], step * width, trains[0], sensor
        )
    for d in range(4):
        for c in range(n_c):
            for h in range(width):
                trains[0, h, N_SENSORS + d * n_c + c] = cells.inbox[i, d, c, h]
    snn.run_network(
        cells.lif, cells.sizes, cells.weights[i], cells.ceilings[i],
        trains, cells.v[i], cells.psi[i], cells.theta[i],
    )
    output = trains.shape[0] - 1
    count = 0
    for h in range(width):
        count += int(trains[output, h, 0])
    _post(cells, i, output)
    cells.counts[i, cells.age[i] % ACTUATION_WINDOW] = count
    cells.age[i] += 1
    return decode(cells.counts[i], cells.age[i])


@compiled
def _step_mlp(cells, i, readings):
    n_c = cells.inbox.shape[2]
    values = cells.activity[:, 0]
    for sensor in range(N_SENSORS):
        values[0, sensor] = readings[sensor]
    for d in range(4):
        for c in range(n_c):
            values[0, N_SENSORS + d * n_c + c] = cells.inbox[i, d, c, 0]
    mlp.run_network(cells.sizes, cells.weights[i], values)
    output = cells.activity.shape[0] - 1
    _post(cells, i, output)
    cells.age[i] += 1
    return cells.activity[output, 0, 0]


@compiled
def _post(cells, i, output):
    """Copy the output neurons behind the first, the actuation's, into the outbox."""
    n_c = cells.outbox.shape[2]
    for d in range(cells.outbox.shape[1]):
        for c in range(n_c):
            for h in range(cells.outbox.shape[3]):
                cells.outbox[i, d, c, h] = cells.activity[output, h, 1 + d * n_c + c]


class Cells:
    """n cells of one architecture, each with its own state.

    Args:
        architecture: what kind of cell.
        weights: (n, weights_per_cell), a row per cell.

    Raises:
        InvalidInput: `weights` has another shape or is not finite.
    """

    def __init__(self, architecture: Architecture, weights: np.ndarray) -> None:
        weights = np.array(weights, dtype=np.float64, order='C')
        expected = architecture.weights_per_cell
        if weights.ndim != 2 or weights.shape[1] != expected or not np.isfinite(weights).all():
            shown = f'shape {weights.shape}, finite: {bool(np.isfinite(weights).all())}'
            raise InvalidInput('weights', shown, f'finite numbers of shape (n, {expected})')
        self.architecture = architecture
        n, sizes = len(weights), architecture.layer_sizes
        neurons = (n, len(sizes), max(sizes))
        message = (architecture.n_c, architecture.message_width)
        self.state = CellState(
            spiking=architecture.spiking,
            sizes=np.array(sizes, dtype=np.int64),
            weights=weights,
            ceilings=np.array(
                [snn.threshold_ceilings(sizes, w, architecture.homeostasis) for w in weights]
                if architecture.spiking
                else np.zeros(neurons)
            ),
            lif=snn.lif_constants(architecture.homeostasis, architecture.as_printed),
            v=np.zeros(neurons),
            psi=np.zeros(neurons),
            theta=np.zeros(neurons),
            last_spike=np.zeros((n, N_SENSORS), dtype=np.int64),
            counts=np.zeros((n, ACTUATION_WINDOW), dtype=np.int64),
            age=np.zeros(n, dtype=np.int64),
            inbox=np.zeros((n, len(DIRECTIONS), *message)),
            outbox=np.zeros((n, architecture.n_destinations, *message)),
            activity=np.zeros((len(sizes), architecture.message_width, max(sizes))),
        )
        self.reset()

    def reset(self) -> None:
        """Forget everything but the weights."""
        s = self.state
        for array in (s.v, s.psi, s.counts, s.age, s.inbox, s.outbox):
            array.fill(0)
        s.theta.fill(snn.THETA_0)
        s.last_spike.fill(NEVER)

    @property
    def outbox(self) -> np.ndarray:
        """Return the (n, n_destinations, n_c, width) messages sent last; shared, not a copy."""
        return self.state.outbox

    def step_cell(self, i: int, readings: np.ndarray, inbox: np.ndarray, step: int) -> float:
        """Advance cell `i` by control step `step` and return its actuation.

        Args:
            readings: (4,) in [0, 1].
            inbox: (4, n_c, width) messages from above, left, below, right.
        """
        self.state.inbox[i] = inbox
        return step_cell(self.state, i, np.asarray(readings, dtype=np.float64), step)
