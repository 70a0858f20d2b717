"""The generated C of one cell: `params.h` with sizes and types, `weights.c` with its numbers."""

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.numerics import elementary_functions, single_precision
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.layers import layers_of
from snca_ros.cell.models.arithmetic import (
    LOWEST,
    UNIT,
    FixedLif,
    Float32Lif,
    Float32LifAsPrinted,
    Float32Perceptron,
)
from snca_ros.cell.models.lif import Lif, LifAsPrinted
from snca_ros.cell.models.model import quantised
from snca_ros.cell.models.perceptron import Perceptron
from snca_ros.firmware.identity import Identity

_KNOWN = (
    Lif, LifAsPrinted, Perceptron, Float32Lif, Float32LifAsPrinted, Float32Perceptron, FixedLif,
)
_PER_LINE = {'double': 4, 'float32': 6, 'int16': 14, 'int8': 18}  # numbers in weights.c
_TYPES = {'double': 'double', 'float32': 'float', 'int16': 'int16_t', 'int8': 'int8_t'}
_LARGEST = {'double': 'DBL_MAX', 'float32': 'FLT_MAX'}

_PERCEPTRON = {
    'double': (elementary_functions, 20.0, 13, 52, 1023, 'uint64_t'),
    'float32': (single_precision, 10.0, 7, 23, 127, 'uint32_t'),
}
"""Module of tanh, argument from which on it is 1, terms of its series, and the format of numbers:
bits of the significand, bias of the exponent, integer of the same size."""


def check_known(architecture: Architecture) -> None:
    """Raise InvalidInput, with the name of the neuron model, if there is no C for it."""
    if type(architecture.model) not in _KNOWN:
        expected = 'mlp, snn or snn-h: there is no C for other neuron models'
        raise InvalidInput('neuron_model', architecture.neuron_model, expected)


@dataclass(frozen=True)
class CellSource:
    """The generated C of one cell.

    Attributes:
        architecture: of the cell, with its arithmetic.
        weights: (parameters_per_cell,).
        label: name of controller and voxel, for people.

    Raises:
        InvalidInput: there is no C for the neuron model.
    """

    architecture: Architecture
    weights: np.ndarray
    label: str

    def __post_init__(self) -> None:
        check_known(self.architecture)

    @property
    def identity(self) -> Identity:
        """Return what identifies the firmware."""
        return Identity.of(self.architecture, self.weights)

    @property
    def _number(self) -> Callable[[float], str]:
        """Return the function that writes a potential [mV] or value as a literal of C."""
        if self._integer:
            return lambda mv: str(round(mv / UNIT))
        return _float if self.architecture.arithmetic == 'float32' else _double

    @property
    def _integer(self) -> bool:
        return isinstance(self.architecture.model, FixedLif)

    def params_h(self) -> str:
        """Return the text of params.h."""
        cell, identity = self.architecture, self.identity
        kind = _TYPES[cell.arithmetic]
        number, reading, actuation = (
            ('int32_t', 'uint16_t', 'int16_t') if self._integer else (kind, kind, kind)
        )
        word = 'uint16_t' if cell.spiking else number
        sizes = ', '.join(map(str, cell.layer_sizes))
        hashed = ', '.join(f'0x{byte:02x}' for byte in identity.hash)
        in_range = '((void)(r), 1)' if self._integer else '((r) >= 0 && (r) <= 1)'
        lines = [
            '/* Sizes and types of the cell; written by `snca firmware`. */',
            '#ifndef PARAMS_H', '#define PARAMS_H', '',
            f'#define LABEL "{self.label}"', f'#define HASH {{{hashed}}}',
            f'#define ARITHMETIC {identity.arithmetic_index} /* {cell.arithmetic} */',
            f'#define INTEGER {int(self._integer)}', f'#define SPIKING {int(cell.spiking)}',
            f'#define AS_PRINTED {int(cell.as_printed)}', '',
            f'#define N_SENSORS {len(cell.sensors)} /* {", ".join(cell.sensors)} */',
            f'#define N_C {cell.n_c}', f'#define N_DESTINATIONS {cell.n_destinations}',
            f'#define LAYER_SIZES {{{sizes}}}', f'#define N_NEURONS {sum(cell.layer_sizes)}', '',
            f'typedef {number} number; /* potentials, values */', f'typedef {reading} reading;',
            f'typedef {actuation} actuation;', f'typedef {kind} weight;',
            f'typedef {word} word; /* a train of spikes, or a value */',
            f'#define IS_READING(r) {in_range}', '',
            *(self._spiking() if cell.spiking else self._perceptron()), '', '#endif',
        ]
        return '\n'.join(lines) + '\n'

    def _spiking(self) -> Iterable[str]:
        """Return the constants of a LIF neuron."""
        model, write = self.architecture.model, self._number
        assert isinstance(model, (Lif, LifAsPrinted, FixedLif))
        in_mv = '((w) * (1 << shifts[layer]))' if self._integer else '(w)'
        yield f'#define IN_MV(w, layer) {in_mv}'
        for name in ('theta_0', 'v_rest', 'psi_inc'):
            value = getattr(model, name)
            yield f'#define {name.upper()} {write(value)} /* {value:.6g} mV */'
        if isinstance(model, FixedLif):
            yield f'#define LOWEST ({write(LOWEST)}) /* {LOWEST:g} mV */'
        else:
            yield f'#define LEAK {write(model.leak)} /* lambda dt = {model.leak:.6g} */'

    def _perceptron(self) -> Iterable[str]:
        """Return the constants of tanh."""
        arithmetic, write = self.architecture.arithmetic, self._number
        module, largest, n_terms, mantissa, bias, bits = _PERCEPTRON[arithmetic]
        for name in ('LOG2_E', 'LN2_HIGH', 'LN2_LOW', 'ROUND'):
            value = getattr(module, name)
            literal = write(value)
            yield f'#define {name} {f"({literal})" if value < 0.0 else literal} /* {value!r} */'
        yield f'#define TANH_IS_1 {write(largest)}'
        yield f'#define N_TERMS {n_terms}'
        terms = ', '.join(write(1.0 / math.factorial(n)) for n in range(n_terms + 1))
        yield f'#define INVERSE_FACTORIALS {{{terms}}}'
        yield f'typedef {bits} bits; /* of a number: its significand has MANTISSA */'
        yield f'#define MANTISSA {mantissa}'
        yield f'#define EXPONENT_BIAS {bias}'

    def weights_c(self) -> str:
        """Return the text of weights.c."""
        cell, model = self.architecture, self.architecture.model
        n_evolved = len(model.evolved)
        rows, shifts = [], [16]
        constants = [self._input_constants()]
        for layer in layers_of(cell.layer_sizes, self.weights, n_evolved):
            synapses = quantised(model, layer.synapses)
            constants.append(model.neuron_constants(synapses, layer.evolved)[0])
            unit = 1.0
            if isinstance(model, FixedLif):
                unit = model.weight_unit(layer.synapses)
                shifts.append(round(math.log2(unit / UNIT)))
            rows.append((synapses / unit).T.ravel())
        write_weight = (lambda w: str(round(w))) if self._integer else self._number
        values = np.concatenate(constants)
        parts = [
            '/* Constants of the cell; written by `snca firmware`. */',
            *(['#include <float.h>', ''] if not np.isfinite(values).all() else []),
            '#include "cell.h"', '',
            _array('weight weights', np.concatenate(rows), write_weight, cell.arithmetic), '',
            _array('number constants', values, self._constant, 'float32'),
        ]
        if self._integer:
            parts += ['', f'const uint8_t shifts[] = {{{", ".join(map(str, shifts))}}};']
        return '\n'.join(parts) + '\n'

    def _input_constants(self) -> np.ndarray:
        """Return the constants of the input neurons, each of which has one synapse of weight 1."""
        model, n = self.architecture.model, self.architecture.n_inputs
        evolved = np.tile(np.array([*model.evolved.values()])[:, None], (1, n))
        return model.neuron_constants(np.ones((1, n)), evolved)[0]

    def _constant(self, value: float) -> str:
        # An infinite bound of a threshold: no threshold is above the largest number.
        return self._number(value) if math.isfinite(value) else _LARGEST[
            self.architecture.arithmetic
        ]


def _double(value: float) -> str:
    return (float(value) + 0.0).hex()  # + 0.0 makes a negative zero positive


def _float(value: float) -> str:
    return f'{(float(np.float32(value)) + 0.0).hex()}F'


def _array(name: str, values: np.ndarray, write: Callable[[float], str], arithmetic: str) -> str:
    """Return the definition of a constant array."""
    texts, width = [write(value) for value in values.tolist()], _PER_LINE[arithmetic]
    lines = [', '.join(texts[i : i + width]) for i in range(0, len(texts), width)]
    body = ',\n    '.join(lines)
    return f'const {name}[] = {{\n    {body},\n}};'
