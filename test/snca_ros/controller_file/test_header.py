"""The header and the parameters of a controller file: every wrong value is named."""

import json
import os
import subprocess
import sys
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.controller_files import THETA, json_values, quick, refusal, write
from support.limits import LIMIT
from support.paths import ROOT

from sim_node.engine import ENGINES
from sim_node.errors import InvalidInput
from sim_node.model.body_file import load_body
from sim_node.model.material import Material
from sim_node.model.sensors import DEFAULT_SENSORS
from snca_ros.cell.models import NEURON_MODELS
from snca_ros.controller_file import load_controller
from snca_ros.evolution.tasks import TASKS


@pytest.mark.parametrize(
    'theta',
    [
        THETA.astype(np.float32),
        THETA.astype('>f8'),
        THETA.astype(complex),
        THETA.astype(int),
        THETA > 0,
        THETA.astype(str),
        THETA.astype([('x', 'f8')]),
        THETA.astype('M8[s]'),
        THETA[:-1],
        np.append(THETA, 0.0),
        THETA[None],
        THETA[:, None],
        np.array(1.0),
        np.empty(0),
        np.empty((117, 0)),
        np.tile(THETA, 2),
    ],
    ids=lambda theta: f'{theta.dtype}-{theta.shape}',
)
def test_theta_of_another_kind(path, header, theta):
    write(path, header, theta)
    text = refusal(path)
    assert text.startswith('theta: got ')
    assert text.endswith('expected float64 of shape (117,)')


def test_theta_of_a_non_uniform_robot_has_all_voxels(path, header):
    grid = {'name': 'three', 'grid': '111'}
    header = {
        **header, 'morphology': grid, 'architecture': {**header['architecture'], 'uniform': False}
    }
    write(path, header, np.zeros(117))
    assert '(351,)' in refusal(path)
    write(path, header, np.zeros(351))
    assert len(load_controller(path).controller().cells.state.network.weights) == 3


@pytest.mark.parametrize('index', [0, 5, 116])
@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_first_theta_that_is_not_finite_is_named(path, header, index, value):
    theta = THETA.copy()
    theta[index] = theta[-1] = value
    write(path, header, theta)
    assert refusal(path) == f'theta[{index}]: got {value}, expected a finite number'


def changed(header: dict, field: str, value) -> dict:
    """Return a copy of `header` with `value` in `field`, such as 'solver.substeps'."""
    name, _, rest = field.partition('.')
    return {**header, name: changed(header.get(name, {}), rest, value) if rest else value}


NOT_A_DICT = [None, True, 3, 'text', [], ['uniform']]
NOT_A_SIZE = [None, 0, -1, 1.0, '1', True, [1], {}, 10**30]
WRONG = {
    'sensors': [
        None, True, 3, 'area', {}, [], ['area'] * 2, ['aera', *DEFAULT_SENSORS[1:]], [3], [[]],
        [None], [*DEFAULT_SENSORS, 'os'], ['area', 'touch'],
    ],
    'format_version': [None, '1', 1.0, True, [1], {}, 0, 3, -1, 10**30],
    'architecture': NOT_A_DICT,
    'architecture.uniform': [None, 1, 'true', [], {}],
    'architecture.directional': [None, 0, 'false', [], {}],
    'architecture.neuron_model': [None, 3, True, 'snn_h', '', ['mlp'], {}],
    'architecture.n_c': [0, 65, 1.0, '1', True, [1], {}],
    'architecture.hidden': [8, '8', {}, [0], [1025], ['8'], [8.0], [True], [[8]], [1] * 9],
    'architecture.as_printed': [None, 0, 'no', [], {}],
    'morphology': NOT_A_DICT,
    'morphology.name': [None, 5, True, [], {}],
    'morphology.grid': [None, 11, True, [], ['11'], {}, '', '00', '101', '11-1', '12', 'bipd'],
    'terrain': [None, 5, True, [], {}, '', 'hily-1-10-0', 'hilly-1-10', 'uphill-61', 'flat\n'],
    'material': NOT_A_DICT,
    'solver': NOT_A_DICT,
    'solver.substeps': [*NOT_A_SIZE, 101],
    'solver.iterations': [*NOT_A_SIZE, 1001],
    'solver.self_collision': [None, 0, 'no', [], {}],
    'solver.physics': [None, 0, True, '', 'References', [], {}],
    'fitness': [None, True, '1', [], {}, 10**400],
    'seed': [None, True, 1.5, '0', [], {}, -1],
    'evaluations': [None, True, 1.5, '0', [], {}, -1],
    'versions': [None, True, 3, 'text', [], ['numpy']],
    'chosen_by': [None, True, 3, '', 'Pymunk', [], {}],
    'task': [None, True, 3, '', 'Walk', 'no.such.module', [], {}],
    'scores': [None, 1.0, 'text', [], {'pymunk': '1'}, {'pymunk': None}, {'bullet': 1.0}],
}
SINCE_TWO_ENGINES = ('chosen_by', 'v_x')  # older files of version 1 have none
for _f in fields(Material):
    WRONG[f'material.{_f.name}'] = [None, True, '1', [], {}, np.nan, np.inf, -1e-9, 1e9, 10**400]


@pytest.mark.parametrize('field', WRONG)
def test_wrong_value_is_named(path, header, field):
    load_ok = changed(header, 'fitness', 1.0)
    write(path, load_ok, THETA)
    load_controller(path)
    # A complaint about 'morphology.grid' may say 'morphology', one about 'solver.substeps' not.
    words = field.split('.')[:1] if field == 'morphology.grid' else field.split('.')[-1:]
    for value in WRONG[field]:
        write(path, changed(header, field, value), THETA)
        named = refusal(path).split(': got ')[0]
        of_size = field == 'sensors' and value == ['area', 'touch']  # other cells, other weights
        assert ('theta' if of_size else words[0]) in named, f'{field} = {value!r}'


SET = {'shape': '11', 'terrain': 'flat', 'faults': 'none', 'starts': 0, 'draw': 8,
       'score': 'mean', 'scored': 32}


TEXTS = 'bipd', '11,101', 'los=1', 'x.yaml'  # errors name what they describe


@pytest.mark.parametrize(('name', 'values'), {
    'shape': [None, 3, [], 'bipd', '11,101'], 'terrain': [None, 3, 'hily-1-10-0'],
    'faults': [None, 3, 'los=1', 'x.yaml'], 'starts': [None, -1, True, 1.5],
    'draw': [None, -1, '8'], 'score': [None, 'median', 3], 'scored': [None, 0, -1, True, 1.5],
}.items())
def test_wrong_values_of_the_set_of_episodes_are_named(path, header, name, values):
    write(path, {**header, 'fitness': 1.0, 'episode_set': SET}, THETA)
    assert load_controller(path).n_episodes == 32
    for value in values:
        said = {'faults': '', 'shape': 'morphology'}.get(name, name) if value in TEXTS else name
        write(path, {**header, 'fitness': 1.0, 'episode_set': {**SET, name: value}}, THETA)
        assert said in refusal(path).split(': got ')[0]
    of_it = {key: value for key, value in SET.items() if key != name}
    for wrong in (of_it, {**SET, 'more': 1}, None, 3, []):
        write(path, {**header, 'fitness': 1.0, 'episode_set': wrong}, THETA)
        assert 'episode_set' in refusal(path)


def test_every_field_has_its_wrong_values(header):
    nested = ('architecture', 'morphology', 'material', 'solver')
    names = {*header, *(f'{name}.{key}' for name in nested for key in header[name])}
    assert names == set(WRONG)


@pytest.mark.parametrize(
    'field', [f for f in WRONG if '.' not in f and f not in (*SINCE_TWO_ENGINES, 'sensors')]
)
def test_missing_field_is_named(path, header, field):
    write(path, {name: value for name, value in header.items() if name != field}, THETA)
    assert refusal(path).startswith(f'{field}: got None')


@pytest.mark.parametrize(
    'field',
    ['morphology.name', 'morphology.grid', 'architecture.uniform', 'architecture.directional',
     'architecture.neuron_model'],
)
def test_missing_inner_field_is_named(path, header, field):
    outer, inner = field.split('.')
    cut = {name: value for name, value in header[outer].items() if name != inner}
    write(path, {**header, outer: cut}, THETA)
    assert refusal(path).startswith(outer)


@pytest.mark.parametrize('outer', ['', 'architecture', 'morphology', 'material', 'solver'])
def test_unknown_field_is_named(path, header, outer):
    write(path, changed(header, f'{outer}.extra'.lstrip('.'), 1), THETA)
    text = refusal(path)
    assert 'extra' in text
    assert outer in text


@pytest.mark.parametrize('entry', ['header', 'theta'])
def test_missing_entry_is_named(path, header, entry):
    entries = {'header': header, 'theta': THETA, entry: None}
    write(path, **entries)
    assert refusal(path).startswith(f"file: got 'no entry {entry}'")


def test_empty_archive(path):
    np.savez(path)
    assert refusal(path).startswith("file: got 'no entry header'")


@pytest.mark.parametrize(
    'text', ['', '{', '[]', '3', 'null', '"x"', '{} {}', '\ufeff{}', '[' * 100_000, '9' * 5000]
)
def test_header_that_is_no_json_object(path, text):
    write(path, np.array(text), THETA)
    assert refusal(path).startswith('header: got ')


@pytest.mark.parametrize('kind', ['bytes', 'list', 'number', 'record', 'empty'])
def test_header_that_is_no_text(path, header, kind):
    text = json.dumps(header)
    arrays = {
        'bytes': np.array(text.encode()),
        'list': np.array([text]),
        'number': np.array(3.0),
        'record': np.array([(text, 1)], dtype=[('a', 'U2000'), ('b', 'i4')]),
        'empty': np.empty((0, 3), dtype='U1'),
    }
    write(path, arrays[kind], THETA)
    assert refusal(path).startswith('header: got ')


@quick
@given(field=st.sampled_from(sorted(WRONG)), value=json_values)
def test_any_value_is_taken_or_refused_by_name(tmp_path_factory, header, field, value):
    path = tmp_path_factory.mktemp('any') / 'any.npz'
    write(path, changed(header, field, value), THETA)
    try:
        load_controller(path)
    except InvalidInput as error:
        complaint = str(error)
    else:
        complaint = f'{path}: '
    assert complaint.startswith(f'{path}: ')


@quick
@given(header=json_values)
def test_any_header_is_refused(tmp_path_factory, header):
    path = tmp_path_factory.mktemp('any') / 'any.npz'
    write(path, header if header is not None else 'null', THETA)
    refusal(path)


def test_near_misses_are_told(path, header):
    for field, value, hint in [
        ('architecture.neuron_model', 'snn_h', 'snn-h'),
        ('terrain', 'hily-1-10-0', 'hilly'),
        ('material.gravty', 1.0, 'gravity'),
        ('architecture.neuron_modl', 'mlp', 'neuron_model'),
        ('solver.iteration', 1, 'iterations'),
    ]:
        write(path, changed(header, field, value), THETA)
        assert f"did you mean '{hint}'?" in refusal(path)


def test_files_from_before_there_were_two_engines(path, header):
    old = {name: value for name, value in version_1(header).items()
           if name not in SINCE_TWO_ENGINES}
    write(path, old, THETA)
    trained = load_controller(path)
    assert (trained.chosen_by, trained.scores) == ('pymunk', {})


def version_1(header):
    """Return the header as it was before there were tasks."""
    since = 'sensors', 'task', 'scores'
    old = {name: value for name, value in header.items() if name not in since}
    return {**old, 'format_version': 1, 'v_x': {'pymunk': 7.5}}


def test_files_of_version_1_are_walks(path, header):
    write(path, version_1(header), THETA)
    trained = load_controller(path)
    assert (trained.task, trained.scores) == ('walk', {'pymunk': 7.5})
    assert trained.architecture.sensors == load_body(path).sensors == DEFAULT_SENSORS
    assert load_body(path).terrain == trained.terrain
    for value in WRONG['scores']:
        write(path, {**version_1(header), 'v_x': value}, THETA)
        assert refusal(path).startswith('v_x')


@pytest.mark.parametrize('version', [1, 2])
def test_fields_of_the_other_version_are_unknown(path, header, version):
    headers = {1: version_1(header), 2: header}
    foreign = headers[3 - version].keys() - headers[version].keys()
    assert foreign == ({'sensors', 'task', 'scores'} if version == 1 else {'v_x'})
    for name in foreign:
        write(path, {**headers[version], name: headers[3 - version][name]}, THETA)
        assert refusal(path).startswith(f"header: got '{name}', expected one of ")


@pytest.mark.parametrize(('field', 'known'), [
    ('task', TASKS), ('architecture.neuron_model', NEURON_MODELS), ('chosen_by', ENGINES),
])
def test_an_unknown_name_is_refused_and_imports_nothing(
    path, header, field, known, tmp_path, monkeypatch
):
    (tmp_path / 'named_by_a_file.py').write_text('raise SystemExit("imported")')
    monkeypatch.syspath_prepend(tmp_path)
    name = 'named_by_a_file'
    write(path, changed(header, field, name), THETA)
    refusal(path)  # whatever is loaded lazily is loaded now
    before = set(sys.modules)
    assert f"got '{name}', expected one of {', '.join(known)}" in refusal(path)
    write(path, changed(header, field, f'{name}:thing'), THETA)
    assert name in refusal(path)
    assert set(sys.modules) == before
    if field == 'task':
        assert load_body(path).terrain == 'flat'  # the simulation does not need it


def test_reading_a_controller_loads_tasks_and_sets_but_no_evolution(path, header):
    write(path, header, THETA)
    program = (
        'import sys; from snca_ros.nodes import own_part\n'
        'from snca_ros.faults import NO_FAULTS\n'
        f"own_part.load_own_part({str(path)!r}, 'voxel_0_0', NO_FAULTS, 'here')\n"
        "print(sorted(name for name in sys.modules if name.startswith('snca_ros.evolution.')), "
        "'pymunk' in sys.modules)"
    )
    found = subprocess.run(
        [sys.executable, '-c', program], check=True, capture_output=True, text=True, timeout=LIMIT,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
    ).stdout.strip()
    names = ('conditions', 'episode_set', 'fault_ranges', 'tasks', 'tasks.climb', 'tasks.economy',
             'tasks.jump', 'tasks.task', 'tasks.walk')
    assert found == f'{[f"snca_ros.evolution.{name}" for name in names]} False'


def test_sensors_in_another_order_are_those_of_cells_and_body(path, header):
    names = DEFAULT_SENSORS[::-1]
    write(path, {**header, 'sensors': list(names)}, THETA)
    trained = load_controller(path)
    assert trained.architecture.sensors == trained.simulation().sensors == names
    assert load_body(path).sensors == names


def test_an_unknown_sensor_is_refused_with_the_known_ones_and_imports_nothing(path, header):
    write(path, {**header, 'sensors': ['area', 'antigravity']}, THETA)
    known = f"sensors: got 'antigravity', expected one of {', '.join(DEFAULT_SENSORS)}"
    assert refusal(path) == known
    with pytest.raises(InvalidInput, match='expected one of area, touch, velocity_x, velocity_y'):
        load_body(path)
    assert 'antigravity' not in sys.modules
