"""Checks a neuron model when it is registered, so that a mistake is reported in one line."""

from typing import Any

import numpy as np
from numba.core.errors import NumbaError

from sim_node.errors import InvalidInput
from sim_node.numerics.jit import compiled
from sim_node.numerics.lane_array import zeros
from sim_node.numerics.lane_tuples import load_each, store_each
from sim_node.numerics.lanes import load, select, store
from sim_node.registry import Registry, check_class_name
from snca_ros.cell.models.model import NeuronModel, bias, step

_WIDTH = 4  # lanes in which a step is tried


class NeuronModelRegistry(Registry[NeuronModel]):
    """Neuron models by name."""

    def register(self, name: str, entry: NeuronModel) -> None:
        """Add a neuron model after one step of it, on numbers and on lanes.

        Raises:
            InvalidInput: it is no such model as `NeuronModel` describes, or the name is taken.
        """
        where = f'{self.kind} {name}'
        if not isinstance(entry, tuple) or not hasattr(entry, '_fields'):
            expected = 'an object of a class of named tuples, such as Leaky()'
            raise InvalidInput(where, entry, expected)
        if type(getattr(entry, 'spiking', None)) is not bool:
            raise InvalidInput(f'{where}.spiking', getattr(entry, 'spiking', None), 'True or False')
        for field in ('state', 'evolved'):
            _check_values(f'{where}.{field}', getattr(entry, field, None))
        own = _own_constants(where, entry)
        known = [*self.values()]
        known += [model.as_printed() for model in known if hasattr(model, 'as_printed')]
        check_class_name(where, type(entry), map(type, known))
        _check_step(where, entry, own)
        super().register(name, entry)


def _check_values(field: str, values: Any) -> None:
    expected = "a dict of names and numbers, such as {'v': 0.0}"
    if not isinstance(values, dict):
        raise InvalidInput(field, values, expected)
    for name, value in values.items():
        if not isinstance(name, str) or not isinstance(value, (int, float)):
            raise InvalidInput(field, values, expected)


def _own_constants(where: str, model: NeuronModel) -> tuple[float, ...]:
    """Return the constants of the first of two neurons with three synapses."""
    evolved = np.zeros((len(model.evolved), 2))
    try:
        own = model.neuron_constants(np.ones((3, 2)), evolved)
    except Exception as error:
        raise InvalidInput(
            f'{where}.neuron_constants', f'{type(error).__name__}: {error}',
            'a method of (synapses, evolved) that returns a tuple of arrays',
        ) from error
    if not isinstance(own, tuple) or any(np.shape(array) != (2,) for array in own):
        expected = 'a tuple of arrays, each with a number per neuron, (n,)'
        raise InvalidInput(f'{where}.neuron_constants', own, expected)
    return tuple(float(array[0]) for array in own)


def _check_step(where: str, model: NeuronModel, own: tuple[float, ...]) -> None:
    """Step a neuron, as a number and as lanes; InvalidInput if that fails."""
    field = f'{where}.step'
    if not hasattr(getattr(type(model), 'step', None), 'py_func'):
        raise InvalidInput(field, None, 'a static method with the decorator compiled_inline')
    state = tuple(float(value) for value in model.state.values())
    sent = 'spikes' if model.spiking else 'value'
    expected = f'a method that returns ({sent}, ({", ".join(model.state)}{"," * bool(state)}))'
    try:
        result = step(model, state, own, 0.5 + bias(model, own))
    except (NumbaError, TypeError, ValueError, IndexError) as error:
        raise InvalidInput(field, _first_line(error), expected) from error
    shape_fits = isinstance(result, tuple) and len(result) == 2
    if not shape_fits or not isinstance(result[1], tuple) or len(result[1]) != len(state):
        raise InvalidInput(field, result, expected)
    arrays = [zeros((1, 1), _WIDTH) for _ in (*state, *own)]
    for array, value in zip(arrays, (*state, *own), strict=True):
        array['lane'] = value
    variables, constants = tuple(arrays[: len(state)]), tuple(arrays[len(state) :])
    try:
        _try_lanes[model.spiking](model, variables, constants, zeros((1, 1), _WIDTH))
    except (NumbaError, TypeError, ValueError) as error:
        raise InvalidInput(
            field, _first_line(error),
            'code for many neurons side by side: select(condition, a, b) in place of `if`, and '
            'the functions that docs/python.md lists',
        ) from error


@compiled
def _try_spiking(model, state, own, total):
    mine = load_each(own, 0, 0)
    current = load(total, 0, 0) + bias(model, mine)
    spikes, new = step(model, load_each(state, 0, 0), mine, current)
    store(total, 0, 0, select(spikes, current, 0.0))
    store_each(state, 0, 0, new)


@compiled
def _try_values(model, state, own, total):
    mine = load_each(own, 0, 0)
    current = load(total, 0, 0) + bias(model, mine)
    value, new = step(model, load_each(state, 0, 0), mine, current)
    store(total, 0, 0, value)
    store_each(state, 0, 0, new)


_try_lanes = {True: _try_spiking, False: _try_values}


def _first_line(error: Exception) -> str:
    """Return what an error of a compiler says in the end, as one line."""
    lines = [line.strip() for line in str(error).splitlines() if line.strip()]
    telling = [line for line in lines if not line.startswith(('During', 'File', '>>>', '-', '^'))]
    return f'{type(error).__name__}: {(telling or lines or [""])[-1]}'
