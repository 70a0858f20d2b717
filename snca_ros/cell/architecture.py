"""The architecture of an embodied neural cellular automaton: options and sizes of its cells."""

from dataclasses import asdict, dataclass

from sim_node.errors import InvalidInput, check_keys, check_name
from sim_node.model.morphology import DIRECTIONS
from sim_node.model.sensors import DEFAULT_SENSORS, check_sensors
from snca_ros.cell.coding import SNN_STEPS
from snca_ros.cell.layers import n_parameters
from snca_ros.cell.models import NEURON_MODELS, NeuronModel, printed_variant
from snca_ros.cell.models.arithmetic import DEFAULT_ARITHMETIC, in_arithmetic

ARCHITECTURES = ('U-nD', 'U-D', 'nU-D', 'nU-nD')
"""Uniform or not (U, nU) and directional or not (D, nD); the paper studies the first three."""

DEFAULT_ARCHITECTURE = 'U-nD'

_MAX_N_C, _MAX_HIDDEN, _MAX_LAYERS = 64, 1024, 8


@dataclass(frozen=True)
class Architecture:
    """The architecture of a robot's cells.

    Attributes:
        uniform: whether all voxels share one set of weights.
        directional: whether a cell sends a different message to each side, or the same to all.
        neuron_model: name of one of `NEURON_MODELS`.
        n_c: message channels per direction; None for the paper's 4 (nD) or 1 (D).
        hidden: sizes of the hidden layers; None for the paper's one, as wide as the input.
        as_printed: whether to use the paper's printed equations where the authors' code differs.
        sensors: names of the sensors that a cell reads, in the order of its first inputs.
        arithmetic: arithmetic of the cells, one of `models.arithmetic.ARITHMETICS`.

    Raises:
        InvalidInput: a value is of the wrong type or out of range.
    """

    uniform: bool
    directional: bool
    neuron_model: str
    n_c: int = None  # type: ignore[assignment]  # filled in below
    hidden: tuple[int, ...] = None  # type: ignore[assignment]
    as_printed: bool = False
    sensors: tuple[str, ...] = DEFAULT_SENSORS
    arithmetic: str = DEFAULT_ARITHMETIC

    def __post_init__(self) -> None:
        for name in ('uniform', 'directional', 'as_printed'):
            if not isinstance(getattr(self, name), bool):
                raise InvalidInput(name, getattr(self, name), 'true or false')
        NEURON_MODELS.find(self.neuron_model)
        in_arithmetic(self._in_doubles, self.arithmetic)
        object.__setattr__(self, 'sensors', check_sensors(self.sensors))
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
        """Return the architecture with the paper's shorthand `name`, such as 'U-nD'."""
        check_name('architecture', name, ARCHITECTURES)
        uniform, directional = name.split('-')
        return cls(uniform == 'U', directional == 'D', neuron_model, **options)

    @property
    def name(self) -> str:
        """Return the paper's shorthand, such as 'U-nD'."""
        return f'{"U" if self.uniform else "nU"}-{"D" if self.directional else "nD"}'

    @property
    def model(self) -> NeuronModel:
        """Return the neuron model in the arithmetic, as the paper prints it if `as_printed`."""
        return in_arithmetic(self._in_doubles, self.arithmetic)

    @property
    def _in_doubles(self) -> NeuronModel:
        model = NEURON_MODELS[self.neuron_model]
        return printed_variant(model) if self.as_printed else model

    @property
    def spiking(self) -> bool:
        """Return whether cells exchange spike trains rather than values."""
        return NEURON_MODELS[self.neuron_model].spiking

    @property
    def message_width(self) -> int:
        """Return the number of values per channel of a message: 16 spikes, or one value."""
        return SNN_STEPS if self.spiking else 1

    @property
    def n_destinations(self) -> int:
        """Return the number of different messages of a cell: 4, or 1 if not directional."""
        return len(DIRECTIONS) if self.directional else 1

    @property
    def n_inputs(self) -> int:
        """Return the number of inputs of a cell: one per sensor and n_c from each side."""
        return len(self.sensors) + len(DIRECTIONS) * self.n_c

    @property
    def n_outputs(self) -> int:
        """Return the number of outputs of a cell: the actuation and the channels it sends."""
        return 1 + self.n_destinations * self.n_c

    @property
    def layer_sizes(self) -> tuple[int, ...]:
        """Return the number of neurons of each layer, from input to output."""
        return self.n_inputs, *self.hidden, self.n_outputs

    @property
    def parameters_per_cell(self) -> int:
        """Return the number of parameters of one cell."""
        return n_parameters(self.layer_sizes, len(self.model.evolved))

    def n_parameters(self, n_voxels: int) -> int:
        """Return the number of evolved parameters of a robot of `n_voxels` voxels."""
        return self.parameters_per_cell * (1 if self.uniform else n_voxels)

    def to_dict(self) -> dict:
        """Return the attributes as numbers, strings and lists, for JSON and YAML.

        The usual arithmetic is left out, so that older versions can read the file.
        """
        values = {**asdict(self), 'hidden': list(self.hidden), 'sensors': list(self.sensors)}
        if self.arithmetic == DEFAULT_ARITHMETIC:
            del values['arithmetic']
        return values

    @classmethod
    def from_dict(cls, values: dict) -> 'Architecture':
        """Return the architecture of a dict from `to_dict`.

        Raises:
            InvalidInput: a key or value is invalid.
        """
        check_keys('architecture', values, list(cls.__dataclass_fields__))
        for key in ('uniform', 'directional', 'neuron_model'):
            if key not in values:
                raise InvalidInput(f'architecture.{key}', None, 'a value')
        return cls(**values)


def _is_size(value: object, high: int) -> bool:
    return isinstance(value, int) and not isinstance(value, bool) and 1 <= value <= high
