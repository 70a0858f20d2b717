"""Architectures: their sizes, their names, what they refuse; and that all of them step."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.against_reference import COMBINATIONS, HIDDEN, MODELS, make_architecture
from support.reference_cell import (
    n_weights_of,
    sizes_of,
)

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from snca_ros.cell.architecture import ARCHITECTURES, Architecture
from snca_ros.cell.cells import Cells
from snca_ros.cell.models import NEURON_MODELS
from snca_ros.controller import Controller

PAPERS = ('U-nD', 'U-D', 'nU-D')
NINE = [(name, model) for name in PAPERS for model in ('mlp', 'snn', 'snn-h')]

quick = settings(max_examples=100)

architectures = st.builds(
    Architecture,
    st.booleans(),
    st.booleans(),
    st.sampled_from(list(NEURON_MODELS)),
    n_c=st.integers(1, 64),
    hidden=st.lists(st.integers(1, 1024), max_size=8).map(tuple),
    as_printed=st.booleans(),
)


# --- sizes ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ('name', 'model', 'sizes', 'per_cell', 'of_biped'),
    [
        ('U-nD', 'snn-h', (20, 20, 5), 500, 500),
        ('U-D', 'mlp', (8, 8, 5), 117, 117),
        ('nU-D', 'mlp', (8, 8, 5), 117, 1170),
    ],
)
def test_the_papers_three(name, model, sizes, per_cell, of_biped):
    architecture = Architecture.named(name, model)
    assert architecture.layer_sizes == sizes
    assert architecture.parameters_per_cell == per_cell
    assert architecture.n_parameters(10) == of_biped


@pytest.mark.parametrize(('name', 'model'), NINE)
def test_parameters_are_counted_as_the_model_says(name, model):
    directional, uniform = name.endswith('-D'), name.startswith('U')
    n_c = 1 if directional else 4
    n_in, n_out = 4 + 4 * n_c, 1 + (4 * n_c if directional else n_c)
    bias = 1 if model == 'mlp' else 0
    per_cell = (n_in + bias) * n_in + (n_in + bias) * n_out
    architecture = Architecture.named(name, model)
    assert architecture.layer_sizes == (n_in, n_in, n_out)
    assert architecture.parameters_per_cell == per_cell
    for n_voxels in (1, 5, 10):
        expected = per_cell if uniform else per_cell * n_voxels
        assert architecture.n_parameters(n_voxels) == expected


@quick
@given(architectures)
def test_parameters_of_any_network(architecture):
    a, bias = architecture, architecture.neuron_model == 'mlp'
    n_out = 1 + (4 if a.directional else 1) * a.n_c
    sizes = [4 + 4 * a.n_c, *a.hidden, n_out]
    assert list(a.layer_sizes) == sizes
    per_cell = sum((sizes[i] + bias) * sizes[i + 1] for i in range(len(sizes) - 1))
    assert a.parameters_per_cell == per_cell
    assert a.n_parameters(7) == (per_cell if a.uniform else 7 * per_cell)


# --- all nine step ----------------------------------------------------------------------------


@pytest.mark.parametrize('as_printed', [False, True])
@pytest.mark.parametrize(('name', 'model'), NINE)
def test_all_nine_construct_and_step(name, model, as_printed):
    architecture = Architecture.named(name, model, as_printed=as_printed)
    assert architecture.name == name
    morphology = parse_morphology('111-101')
    rng = np.random.default_rng(3)
    theta = rng.uniform(-1, 1, architecture.n_parameters(5))
    controller = Controller(architecture, morphology, theta)
    sent = 0.0
    for k in range(30):
        actuation = controller.step(rng.uniform(0, 1, (5, 4)))
        assert controller.step_count == k + 1
        assert actuation.shape == (5,)
        assert np.all(np.abs(actuation) <= 1.0)
        outbox = controller.cells.outbox
        width = 1 if model == 'mlp' else 16
        assert outbox.shape == (5, *((4, 1) if name.endswith('-D') else (1, 4)), width)
        if model != 'mlp':
            assert np.isin(outbox, (0.0, 1.0)).all()
        sent += np.abs(outbox).sum()
    assert sent > 0.0


@pytest.mark.parametrize(('name', 'model'), NINE)
def test_reset_forgets_everything_but_the_weights(name, model):
    architecture = Architecture.named(name, model)
    rng = np.random.default_rng(4)
    cells = Cells(architecture, rng.normal(size=(1, architecture.parameters_per_cell)))
    readings = rng.uniform(0, 1, (40, 4))
    inbox = np.ones((4, architecture.n_c, architecture.message_width))
    runs = []
    for _ in range(2):
        cells.reset()
        runs.append([cells.step_cell(0, r, inbox, k) for k, r in enumerate(readings)])
    assert runs[0] == runs[1]


def test_cells_keep_weights_of_their_own():
    architecture = Architecture.named('U-D', 'mlp')
    weights = np.ones((1, 117))
    cells = Cells(architecture, weights)
    weights[:] = 0.0
    assert set(cells.state.network.weights['lane'].ravel()) == {0.0, 1.0}  # 0: padding


@pytest.mark.parametrize(
    'weights',
    [
        np.zeros(117),
        np.zeros((1, 116)),
        np.zeros((1, 118)),
        np.zeros((1, 1, 117)),
        np.full((2, 117), np.nan),
        np.full((1, 117), np.inf),
    ],
)
def test_cells_refuse_weights_of_another_kind(weights):
    with pytest.raises(InvalidInput, match=r'weights: got .* \(n, 117\)'):
        Cells(Architecture.named('U-D', 'mlp'), weights)


@pytest.mark.parametrize('shape', [(499,), (501,), (1, 500), (0,), ()])
def test_controller_refuses_a_theta_of_another_shape(shape):
    architecture = Architecture.named('U-nD', 'snn')
    with pytest.raises(InvalidInput, match=r'parameters: got .* \(500,\)'):
        Controller(architecture, parse_morphology('11'), np.zeros(shape))


# --- names and bad values ---------------------------------------------------------------------


@pytest.mark.parametrize('name', ARCHITECTURES)
def test_names_go_both_ways(name):
    assert Architecture.named(name, 'snn').name == name


@pytest.mark.parametrize(
    ('name', 'hint'),
    [('U-ND', 'U-nD'), ('UnD', 'U-nD'), ('nU_D', 'nU-D'), ('U-d', 'U-D'), ('xyz', None)],
)
def test_unknown_architecture(name, hint):
    with pytest.raises(InvalidInput) as caught:
        Architecture.named(name, 'snn')
    text = str(caught.value)
    assert text.startswith(f'architecture: got {name!r}, expected one of U-nD, U-D, nU-D')
    assert ('did you mean' in text) == (hint is not None)
    assert hint is None or f"did you mean '{hint}'?" in text


@pytest.mark.parametrize(
    ('model', 'hint'),
    [('snn_h', 'snn-h'), ('SNN-h', 'snn-h'), ('mpl', 'mlp'), ('sn', 'snn'), ('perceptron', None)],
)
def test_unknown_neuron_model(model, hint):
    with pytest.raises(InvalidInput) as caught:
        Architecture.named('U-nD', model)
    text = str(caught.value)
    assert text.startswith(f'neuron_model: got {model!r}, expected one of mlp, snn, snn-h')
    assert ('did you mean' in text) == (hint is not None)
    assert hint is None or f"did you mean '{hint}'?" in text


BAD = {
    'uniform': [None, 1, 0.0, 'true', [], np.True_],
    'directional': [None, 0, 'no', {}],
    'as_printed': [None, 1, 'yes', [True]],
    'neuron_model': [None, 3, ['mlp'], {'mlp': 1}, b'mlp', True],
    'n_c': [0, -1, 65, 1.0, '4', True, [4], 10**30, float('nan')],
    'hidden': [
        8, '8', {}, {8}, [0], [-1], [1025], [8, '8'], [8.0], [True], [[8]], [None], (1,) * 9,
    ],
}


@pytest.mark.parametrize(('key', 'value'), [(k, v) for k, vs in BAD.items() for v in vs])
def test_bad_value_is_named(key, value):
    good = {'uniform': True, 'directional': False, 'neuron_model': 'snn-h'}
    for make in (lambda d: Architecture(**d), Architecture.from_dict):
        with pytest.raises(InvalidInput) as caught:
            make({**good, key: value})
        assert str(caught.value).startswith(f'{key}: got ')
        assert '\n' not in str(caught.value)


@pytest.mark.parametrize('key', ['uniform', 'directional', 'neuron_model'])
def test_missing_key_is_named(key):
    values = Architecture.named('U-nD', 'snn').to_dict()
    del values[key]
    with pytest.raises(InvalidInput, match=key):
        Architecture.from_dict(values)


@pytest.mark.parametrize(
    ('key', 'hint'),
    [('neuron_modl', 'neuron_model'), ('nc', 'n_c'), ('asprinted', 'as_printed'), ('zzz', ''),
     (5, '')],
)
def test_unknown_key_is_named(key, hint):
    values = {**Architecture.named('U-nD', 'snn').to_dict(), key: 1}
    with pytest.raises(InvalidInput) as caught:
        Architecture.from_dict(values)
    text = str(caught.value)
    assert repr(key) in text
    assert 'neuron_model, n_c, hidden, as_printed' in text
    assert not hint or f"did you mean '{hint}'?" in text


# --- as plain values --------------------------------------------------------------------------


@quick
@given(architectures)
def test_plain_values_go_both_ways(architecture):
    values = architecture.to_dict()
    again = Architecture.from_dict(json.loads(json.dumps(values)))
    assert again == architecture
    assert hash(again) == hash(architecture)
    assert again.to_dict() == values
    assert isinstance(values['hidden'], list)


@pytest.mark.parametrize(('name', 'model'), NINE)
def test_defaults_are_written_out(name, model):
    # A file must not change its meaning when a default does.
    values = Architecture.named(name, model).to_dict()
    n_c = 1 if name.endswith('-D') else 4
    assert values == {
        'uniform': name.startswith('U'), 'directional': name.endswith('-D'),
        'neuron_model': model, 'n_c': n_c, 'hidden': [4 + 4 * n_c], 'as_printed': False,
        'sensors': ['area', 'touch', 'velocity_x', 'velocity_y'],
    }
    short = {key: values[key] for key in ('uniform', 'directional', 'neuron_model')}
    assert Architecture.from_dict(short) == Architecture.named(name, model)


@quick
@given(
    key=st.sampled_from(sorted(BAD)),
    value=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=2),
    ),
)
def test_any_value_is_taken_or_refused_by_name(key, value):
    good = {'uniform': True, 'directional': False, 'neuron_model': 'snn-h'}
    try:
        architecture = Architecture.from_dict({**good, key: value})
    except InvalidInput as error:
        complaint = str(error)
    else:
        complaint = ''
        assert architecture.parameters_per_cell > 0
    assert not complaint or complaint.startswith(f'{key}: got ')


@pytest.mark.parametrize(
    ('name', 'model', 'layer_sizes', 'n_weights', 'n_on_biped'),
    [
        ('U-nD', 'snn-h', (20, 20, 5), 500, 500),
        ('U-nD', 'snn', (20, 20, 5), 500, 500),
        ('U-nD', 'mlp', (20, 20, 5), 525, 525),
        ('U-D', 'mlp', (8, 8, 5), 117, 117),
        ('U-D', 'snn', (8, 8, 5), 104, 104),
        ('nU-D', 'mlp', (8, 8, 5), 117, 1170),
        ('nU-D', 'snn-h', (8, 8, 5), 104, 1040),
    ],
)
def test_named_architectures_have_the_sizes_of_the_paper(
    name, model, layer_sizes, n_weights, n_on_biped
):
    architecture = Architecture.named(name, model)
    assert tuple(architecture.layer_sizes) == layer_sizes
    assert architecture.n_inputs == layer_sizes[0]
    assert architecture.n_outputs == layer_sizes[-1]
    assert architecture.parameters_per_cell == n_weights
    assert architecture.n_parameters(10) == n_on_biped


@pytest.mark.parametrize('hidden', HIDDEN)
@pytest.mark.parametrize('n_c', [1, 2, 3, 5])
@pytest.mark.parametrize('model', MODELS)
@pytest.mark.parametrize('combination', COMBINATIONS)
def test_sizes_of_architectures(combination, model, n_c, hidden):
    architecture = make_architecture(combination, model, n_c, hidden)
    directional = COMBINATIONS[combination][1]
    sizes = sizes_of(n_c, directional, hidden)
    assert list(architecture.layer_sizes) == sizes
    assert architecture.parameters_per_cell == n_weights_of(model, sizes)
