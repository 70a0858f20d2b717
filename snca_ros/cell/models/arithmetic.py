"""Neuron models in other arithmetics than doubles: those of firmware for microcontrollers.

All numbers are stored as doubles, which hold those of each arithmetic exactly. So a cell computes
here, bit for bit, what the C of `snca_ros.firmware` computes with floats or integers.
"""

import math
from typing import Any, NamedTuple

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.errors import InvalidInput, check_name
from sim_node.numerics.elementary_functions import floor
from sim_node.numerics.jit import compiled_inline
from sim_node.numerics.lanes import negation, select
from sim_node.numerics.single_precision import single, tanh
from sim_node.registry import check_class_name
from snca_ros.cell.coding import ACTUATION_WINDOW, F_MAX, F_MIN, SNN_RATE
from snca_ros.cell.models.lif import LEAK, Lif, LifAsPrinted, LifNeuron
from snca_ros.cell.models.model import NeuronModel
from snca_ros.cell.models.perceptron import Perceptron

ARITHMETICS = ('double', 'float32', 'int16', 'int8')
"""Doubles, single precision, and fixed point with weights of 16 or 8 bits."""

DEFAULT_ARITHMETIC = 'double'

UNIT = 2.0**-16
"""Unit of potentials, offsets and thresholds in fixed point [mV]."""

LOWEST = -(2.0**14)
"""Lowest potential in fixed point [mV], which is far below that of any trained cell."""

MOST_CURRENT = 2.0**13
"""Largest sum of absolute weights of a neuron in fixed point [mV]; it keeps 32 bits sufficient."""

READING_UNITS = 65535
"""Number of units of a reading of 1 in fixed point."""

ACTUATION_UNITS = 16384
"""Number of units of an actuation of 1 in fixed point."""

_LEAK_DIVISOR = 96  # 1 / (lambda dt), to which the shifts in `_leak` are fitted


class _Float32:
    """Arithmetic in single precision."""

    @staticmethod
    @compiled_inline
    def rounded(model, x):
        """Return a number rounded to single precision."""
        return single(x)

    def quantised(self, synapses: np.ndarray) -> np.ndarray:
        """Return weights rounded to single precision."""
        return synapses.astype(np.float32).astype(np.float64)


class Float32Lif(_Float32, Lif):
    """A LIF neuron in single precision."""

    def neuron_constants(
        self, synapses: np.ndarray, evolved: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Return the thresholds at rest [mV]."""
        return tuple(map(self.quantised, super().neuron_constants(synapses, evolved)))


class Float32LifAsPrinted(_Float32, LifAsPrinted):
    """A LIF neuron by the letter of the paper in single precision."""

    def neuron_constants(
        self, synapses: np.ndarray, evolved: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Return the bounds of the thresholds [mV]."""
        return tuple(map(self.quantised, super().neuron_constants(synapses, evolved)))


class Float32Perceptron(_Float32, Perceptron):
    """A neuron of a perceptron in single precision."""

    def neuron_constants(
        self, synapses: np.ndarray, evolved: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Return the biases."""
        return tuple(map(self.quantised, super().neuron_constants(synapses, evolved)))

    @staticmethod
    @compiled_inline
    def step(model, state, own, total):
        """Return the value of the neuron; it has no state."""
        return tanh(total), state


@compiled_inline
def _on_grid(x):
    """Return a potential [mV] rounded down to a multiple of `UNIT`, as a shift of integers does."""
    return floor(x / UNIT) * UNIT


@compiled_inline
def _leak(x):
    """Return x / 96 to within 3e-5, rounded, by the shifts that C uses [mV].

    x / 96 = (4/3) x / 128, and 4/3 is nearly (1 + 1/4) (1 + 1/16) (1 + 1/256).
    """
    x = x + _on_grid(x * 0.25)
    x = x + _on_grid(x * 0.0625)
    x = x + _on_grid(x * 0.00390625)
    return _on_grid((x + 64.0 * UNIT) * 0.0078125)


class FixedConstants(NamedTuple):
    """Constants of a LIF neuron in fixed point.

    Attributes:
        psi_inc, theta_0, v_rest: see `LifConstants`; multiples of `UNIT` [mV].
        homeostasis: see `LifConstants`.
        bits: number of bits of a weight.
    """

    psi_inc: float
    theta_0: float
    v_rest: float
    homeostasis: bool
    bits: int


class FixedLif(LifNeuron, FixedConstants):
    """A LIF neuron in fixed point: integers of 32 bits that count `UNIT`.

    The weights of a layer count the same power of two [mV], `weight_unit`.
    """

    def weight_unit(self, synapses: np.ndarray) -> float:
        """Return the unit of a layer's weights [mV], (n_presynaptic, n): at least `UNIT`."""
        largest, most = float(np.abs(synapses).max(initial=0.0)), 2.0 ** (self.bits - 1) - 1.0
        unit = UNIT
        while largest > most * unit:
            unit *= 2.0
        return unit

    def quantised(self, synapses: np.ndarray) -> np.ndarray:
        """Return weights rounded to multiples of their layer's unit [mV].

        Raises:
            InvalidInput: their sum is beyond 32 bits.
        """
        unit = self.weight_unit(synapses)
        rounded = np.round(synapses / unit) * unit
        if (total := float(np.abs(rounded).sum(axis=0).max(initial=0.0))) > MOST_CURRENT:
            expected = f'at most {MOST_CURRENT:g} mV in fixed point'
            raise InvalidInput('sum of the weights of a neuron', f'{total:g} mV', expected)
        return rounded

    def neuron_constants(
        self, synapses: np.ndarray, evolved: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Return the thresholds at rest, min(theta_0, bound) [mV]."""
        return (np.minimum(self.theta_0, self.bounds(synapses)),)

    def thresholds(self, state: tuple[Any, ...], own: tuple[Any, ...]) -> np.ndarray:
        """Return the thresholds [mV]."""
        return own[0] + state[1]

    @staticmethod
    @compiled_inline
    def step(model, state, own, current):
        """Return whether the neuron spikes, and its new potential and offset [mV]; see `Lif`."""
        v, psi = state
        v = max(v + current, LOWEST)
        silent = v < own[0] + psi
        psi = psi + select(silent, -_leak(psi), model.psi_inc)
        return negation(silent), (select(silent, v - _leak(v), model.v_rest), psi)

    @staticmethod
    @compiled_inline
    def spike_period(model, reading):
        """Return the number of SNN steps between the spikes of a reading, see `coding`."""
        units = floor(reading * READING_UNITS + 0.5)
        return floor(SNN_RATE * READING_UNITS / (units * (F_MAX - F_MIN) + F_MIN * READING_UNITS))

    @staticmethod
    @compiled_inline
    def actuation(model, n_spikes, age):
        """Return the actuation in [-1, 1] for a number of spikes in the window, see `coding`."""
        window = F_MAX * min(age, ACTUATION_WINDOW)
        units = floor(2.0 * CONTROL_RATE * ACTUATION_UNITS * n_spikes / window) - ACTUATION_UNITS
        return min(units / ACTUATION_UNITS, 1.0)


_IN_FLOAT32: dict[type, Any] = {
    Lif: Float32Lif, LifAsPrinted: Float32LifAsPrinted, Perceptron: Float32Perceptron,
}
_BITS = {'int16': 16, 'int8': 8}  # of weights
for _kind in (*_IN_FLOAT32.values(), FixedLif):
    check_class_name('arithmetic', _kind, ())  # so that no plug-in takes the name

_WITHOUT_INTEGERS = {
    Perceptron: 'double or float32: a perceptron in integers is not faster than in float32 where '
    'there is a floating-point unit, and some controllers walk more slowly with it',
    LifAsPrinted: 'double or float32: the leak of the printed equations, '
    f'{LEAK / SNN_RATE:.2g} per step, is smaller than the resolution of fixed point',
}


def in_arithmetic(model: NeuronModel, name: str) -> NeuronModel:
    """Return a neuron model in another arithmetic.

    Args:
        model: the model, in doubles.
        name: one of `ARITHMETICS`.

    Raises:
        InvalidInput: there is no such arithmetic, or the model has no equations in it.
    """
    check_name('arithmetic', name, ARITHMETICS)
    if name == DEFAULT_ARITHMETIC:
        return model
    if name == 'float32' and type(model) in _IN_FLOAT32:
        constants: Any = model
        return _IN_FLOAT32[type(model)](*map(_single, constants))
    if name in _BITS and type(model) is Lif:
        return _in_fixed_point(model, _BITS[name])
    unknown = f'double: {type(model).__name__} has no equations in another arithmetic'
    raise InvalidInput('arithmetic', name, _WITHOUT_INTEGERS.get(type(model), unknown))


def _in_fixed_point(model: Lif, bits: int) -> FixedLif:
    if not math.isclose(model.leak * _LEAK_DIVISOR, 1.0):
        expected = f'1 / {_LEAK_DIVISOR} per step in fixed point'
        raise InvalidInput('leak', model.leak, expected)
    psi_inc, theta_0, v_rest = (
        round(mv / UNIT) * UNIT for mv in (model.psi_inc, model.theta_0, model.v_rest)
    )
    return FixedLif(psi_inc, theta_0, v_rest, model.homeostasis, bits)


def _single(constant: Any) -> Any:
    return constant if isinstance(constant, bool) else float(np.float32(constant))
