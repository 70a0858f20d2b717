"""Neuron models from outside the project: one file each, in both engines, and in files."""

import itertools
import math
import subprocess
import sys

import numpy as np
import pytest
from support.limits import LIMIT
from support.plugin_neurons import Pacemaker

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from sim_node.numerics.jit import compiled_inline
from sim_node.numerics.lane_array import zeros
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cell_lanes import make_cells, step_group
from snca_ros.cell.cells import Cells
from snca_ros.cell.models import NEURON_MODELS
from snca_ros.controller import Controller
from snca_ros.controller_file import load_controller, save_controller
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evaluator import evaluate
from snca_ros.evolution.workers import IN_PROCESS
from snca_ros.trained_controller import TrainedController

PLUGINS = {name: NEURON_MODELS.pop(name) for name in ('pacemaker', 'integrator')}
MODELS = pytest.mark.parametrize('name', PLUGINS)
SHAPE = parse_morphology('111-101')


@pytest.fixture(autouse=True)
def _registered():
    NEURON_MODELS.update(PLUGINS)
    yield
    for name in PLUGINS:
        del NEURON_MODELS[name]


def by_hand(architecture, parameters, trains):
    """Return the trains of the output neurons of pacemakers, in plain Python, step by step."""
    sizes, start = architecture.layer_sizes, 0
    v = [[0.0] * n for n in sizes]
    leaks, weights = [[0.01] * sizes[0]], [None]
    for pre, n in itertools.pairwise(sizes):
        evolved = parameters[start : start + n]
        leaks.append([min(max(0.01 + 0.01 * e, 0.0), 0.02) for e in evolved])
        weights.append(parameters[start + n : start + n + pre * n].reshape(pre, n))
        start += n + pre * n
    out = np.zeros((sizes[-1], trains.shape[1]))
    for h in range(trains.shape[1]):
        fires = list(trains[:, h])
        for layer, n in enumerate(sizes):
            after = []
            for j in range(n):
                total = 0.02
                for i, fired in enumerate(fires):
                    if layer == 0:
                        total += 1.0 if i == j and fired else 0.0
                    elif fired:
                        total += weights[layer][i, j]
                now = v[layer][j] + total
                after.append(now >= 1.0)
                v[layer][j] = 0.0 if now >= 1.0 else now - leaks[layer][j] * now
            fires = after
        out[:, h] = fires
    return out


@pytest.mark.parametrize('hidden', [None, (), (3,), (9, 5), (70,)])
def test_spikes_are_those_of_independent_arithmetic(hidden):
    architecture = Architecture.named('U-D', 'pacemaker', hidden=hidden)
    rng = np.random.default_rng(3)
    parameters = rng.uniform(-0.5, 0.5, architecture.parameters_per_cell)
    cells = Cells(architecture, parameters[None])
    n_steps = 30
    spikes = (rng.random((n_steps, 4, 1, 16)) < 0.1).astype(float)
    outbox = []
    for k in range(n_steps):
        cells.step_cell(0, np.zeros(4), spikes[k], k)
        outbox.append(cells.outbox[0, :, 0])
    trains = np.zeros((8, 16 * n_steps))
    trains[4:] = spikes[:, :, 0].transpose(1, 0, 2).reshape(4, -1)
    trains[:4, ::192] = 1.0  # a reading of 0 is 5 Hz, a spike in 192 SNN steps
    expected = by_hand(architecture, parameters, trains)
    np.testing.assert_array_equal(np.concatenate(outbox, axis=1), expected[1:])
    assert 0 < expected[1:].sum() < expected[1:].size


def test_values_are_those_of_independent_arithmetic():
    architecture = Architecture.named('U-D', 'integrator', hidden=(3,))
    rng = np.random.default_rng(4)
    parameters = rng.uniform(-1.0, 1.0, architecture.parameters_per_cell)
    assert len(parameters) == (8 + 1) * 3 + (3 + 1) * 5
    cells = Cells(architecture, parameters[None])
    y = [[0.0] * n for n in architecture.layer_sizes]
    layers = [None, parameters[:27].reshape(9, 3), parameters[27:].reshape(4, 5)]
    for k in range(40):
        readings, inbox = rng.random(4), rng.uniform(-1.0, 1.0, (4, 1, 1))
        actuation = cells.step_cell(0, readings, inbox, k)
        values = [*readings, *inbox.ravel()]
        for layer, matrix in enumerate(layers):
            totals = values if matrix is None else np.array([1.0, *values]) @ matrix
            y[layer] = [0.75 * a + 0.25 * b for a, b in zip(y[layer], totals, strict=True)]
            values = [math.tanh(a) for a in y[layer]]
        np.testing.assert_allclose([actuation, *cells.outbox[0].ravel()], values, atol=1e-12)


@MODELS
@pytest.mark.parametrize('hidden', [None, (7, 3)])
def test_lanes_are_cells_one_by_one(name, hidden):
    architecture = Architecture.named('nU-D', name, n_c=2, hidden=hidden)
    rng = np.random.default_rng(5)
    n, width = SHAPE.n_voxels, 4
    parameters = rng.uniform(-1.0, 1.0, (width, architecture.n_parameters(n)))
    group = make_cells(architecture, SHAPE, parameters, width)
    controllers = [Controller(architecture, SHAPE, row) for row in parameters]
    sensed, actuation = zeros((n, 4), width), zeros((n, 1), width)
    for k in range(100):
        readings = rng.random((n, 4, width))
        sensed['lane'][:] = readings
        step_group(group, sensed, k, actuation)
        expected = [c.step(readings[..., i]) for i, c in enumerate(controllers)]
        np.testing.assert_array_equal(actuation['lane'][:, 0].T, expected)
    assert len(np.unique(expected)) > 1


@MODELS
def test_it_evolves_in_both_engines_and_is_kept_in_a_file(name, tmp_path):
    cells = Architecture.named('U-nD', name)
    config = RunConfig('biped', cells, duration=2.0, transient=0.5, episodes=8, population=4)
    candidates = np.random.default_rng(0).uniform(-1.0, 1.0, (4, config.n_parameters))
    for engine in ('pymunk', 'batched'):
        of_engine = RunConfig(**{**vars(config), 'engine': engine})
        scores = [one.score for one in evaluate(IN_PROCESS, of_engine, candidates)]
        assert len(set(scores)) == 4
        assert np.isfinite(scores).all()
    assert name in config.name
    trained = TrainedController(cells, parse_morphology('biped'), candidates[0])
    save_controller(tmp_path / 'cells.npz', trained)
    loaded = load_controller(tmp_path / 'cells.npz')
    assert loaded.architecture == cells
    np.testing.assert_array_equal(loaded.parameters, candidates[0])


def test_a_file_that_names_an_unknown_model_is_refused_and_imports_nothing(tmp_path):
    cells = Architecture.named('U-nD', 'pacemaker')
    trained = TrainedController(cells, SHAPE, np.zeros(cells.n_parameters(SHAPE.n_voxels)))
    save_controller(tmp_path / 'cells.npz', trained)
    code = (
        'import sys\nfrom sim_node.errors import InvalidInput\n'
        'from snca_ros.controller_file import load_controller\n'
        'before = set(sys.modules)\n'
        'try: load_controller("cells.npz")\n'
        'except InvalidInput as error: print(error)\n'
        'print("support.plugin_neurons" in sys.modules)'
    )
    result = subprocess.run(
        [sys.executable, '-c', code], cwd=tmp_path, capture_output=True, text=True, timeout=LIMIT,
        check=False,
    )
    text, imported = result.stdout.strip().split('\n')
    assert "cells.npz: neuron_model: got 'pacemaker', expected one of mlp, snn, snn-h" in text
    assert imported == 'False'


def test_the_papers_print_is_of_the_papers_models():
    with pytest.raises(InvalidInput, match=r'as_printed: .*no equations of Pacemaker'):
        Architecture.named('U-nD', 'pacemaker', as_printed=True)
    assert NEURON_MODELS['pacemaker'] == Pacemaker()


def variant(**changes):
    """Return a class like `Pacemaker` with other attributes, and a name of its own."""
    name = f'Variant{next(COUNTER)}'
    return type(name, (Pacemaker,), changes)


COUNTER = itertools.count()


@compiled_inline
def one_value(model, state, own, current):
    return current >= model.threshold


@compiled_inline
def too_many(model, state, own, current):
    return current >= model.threshold, (current, current)


@compiled_inline
def misspelt(model, state, own, current):
    return current >= model.treshold, (current,)


@compiled_inline
def branches(model, state, own, current):
    v = state[0] + current
    if v > model.threshold:
        v = 0.0
    return v >= model.threshold, (v,)


@pytest.mark.parametrize(('changes', 'message'), [
    ({'spiking': 'yes'}, r"wrong\.spiking: got 'yes', expected True or False"),
    ({'state': ['v']}, r"wrong\.state: got \['v'\], expected a dict of names and numbers"),
    ({'evolved': {'leak': None}}, r'wrong\.evolved: .*a dict of names and numbers'),
    ({'neuron_constants': lambda self, synapses, evolved: evolved[0]}, 'a tuple of arrays'),
    ({'neuron_constants': lambda self, synapses: ()}, r'neuron_constants: got .TypeError'),
    ({'step': staticmethod(one_value)}, r'wrong\.step: .*that returns \(spikes, \(v,\)\)'),
    ({'step': staticmethod(too_many)}, r'wrong\.step: .*that returns \(spikes, \(v,\)\)'),
    ({'step': staticmethod(misspelt)}, r'wrong\.step: .*treshold'),
    ({'step': staticmethod(branches)}, r'wrong\.step: .*in place of `if`'),
    ({'step': lambda model, state, own, current: None}, 'the decorator compiled_inline'),
])
def test_a_mistake_is_reported_in_one_line_at_registration(changes, message):
    with pytest.raises(InvalidInput, match=message) as error:
        NEURON_MODELS.register('wrong', variant(**changes)())
    assert '\n' not in str(error.value)
    assert 'wrong' not in NEURON_MODELS


def test_a_class_instead_of_an_object_is_refused():
    with pytest.raises(InvalidInput, match=r'an object of a class of named tuples'):
        NEURON_MODELS.register('wrong', Pacemaker)


@pytest.mark.parametrize('name', ['Pacemaker', 'Lif', 'LifAsPrinted'])
def test_a_second_class_of_one_name_is_refused(name):
    # Compiled code is known by the name of the class: the second would run the first one's code.
    again = type(name, (Pacemaker,), {})
    with pytest.raises(InvalidInput, match=r'another class name: .* restart Python'):
        NEURON_MODELS.register('again', again())
