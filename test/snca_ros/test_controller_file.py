"""Controller files: what goes in comes out, and nothing else gets in.

Wrong files are written with plain numpy, so that these tests do not depend on `save_controller`.
"""

import errno
import io
import json
import math
import os
import pickle
import re
import shutil
import subprocess
import sys
import zipfile
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

import snca_ros.controller_file
from sim_node.errors import InvalidInput
from sim_node.model.material import Material
from sim_node.model.morphology import parse_morphology
from sim_node.model.solver import Solver
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import (
    TrainedController,
    code_version,
    load_controller,
    save_controller,
)

NINE = [(name, model) for name in ('U-nD', 'U-D', 'nU-D') for model in ('mlp', 'snn', 'snn-h')]

quick = settings(max_examples=100)

json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=5,
)


def make(name='U-D', model='mlp', shape='11', seed=0, **options) -> TrainedController:
    architecture, morphology = Architecture.named(name, model), parse_morphology(shape)
    n = architecture.n_parameters(morphology.n_voxels)
    theta = np.random.default_rng(seed).uniform(-1, 1, n)
    return TrainedController(architecture, morphology, theta, **options)


def assert_same(one: TrainedController, two: TrainedController) -> None:
    for f in fields(TrainedController):
        a, b = getattr(one, f.name), getattr(two, f.name)
        if f.name == 'theta':
            assert a.dtype == b.dtype == np.float64
            assert a.tobytes() == b.tobytes()
        elif f.name == 'fitness' and math.isnan(a):
            assert math.isnan(b)
        elif f.name != 'versions' or a:  # the saver fills in versions that are not given
            assert a == b, f.name


@pytest.fixture(scope='module')
def header(tmp_path_factory) -> dict:
    """Return the header of a good file."""
    path = tmp_path_factory.mktemp('good') / 'good.npz'
    save_controller(path, make())
    with np.load(path, allow_pickle=False) as data:
        assert set(data.files) == {'header', 'theta'}
        return json.loads(data['header'].item())


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / 'controller.npz'


def write(path, header, theta=None, **entries) -> None:
    """Write a file with `header` (as JSON unless an array) and `theta`; None leaves one out."""
    if header is not None:
        is_array = isinstance(header, np.ndarray)
        entries['header'] = header if is_array else np.array(json.dumps(header))
    np.savez(path, **entries, **({} if theta is None else {'theta': theta}))


def refusal(path: Path) -> str:
    """Return what `load_controller` says against the file: one line that begins with its name."""
    with pytest.raises(InvalidInput) as caught:
        load_controller(path)
    text = str(caught.value)
    assert text.startswith(f'{path}: ')
    assert '\n' not in text
    assert ': got ' in text
    assert ', expected ' in text
    return text.removeprefix(f'{path}: ')


THETA = make().theta


# --- round trip -------------------------------------------------------------------------------


@pytest.mark.parametrize(('name', 'model'), NINE)
def test_what_is_saved_is_loaded(path, name, model):
    trained = make(
        name, model, '111-101', terrain='hilly-0.5-10-3', fitness=2.5, seed=7, evaluations=5000,
        material=Material(gravity=1.6, damping_ratio=0.5), solver=Solver(2, 20, True),
        versions={'numpy': '2.0', 'ψ': '1'},
    )
    save_controller(path, trained)
    again = load_controller(path)
    assert_same(trained, again)
    readings = np.random.default_rng(1).uniform(0, 1, (20, 5, 4))
    one, two = trained.controller(), again.controller()
    for r in readings:
        np.testing.assert_array_equal(one.step(r), two.step(r))


@pytest.mark.parametrize('fitness', [0.0, -0.0, -np.inf, np.inf, np.nan, 1e-310])
def test_every_fitness_is_kept(path, fitness):
    save_controller(path, make(fitness=fitness))
    again = load_controller(str(path)).fitness
    assert np.float64(again).tobytes() == np.float64(fitness).tobytes()


def test_versions_are_told(path):
    save_controller(path, make())
    versions = load_controller(path).versions
    assert set(versions) == {'code', 'snca_ros', 'numpy', 'numba', 'pymunk'}
    assert versions['numpy'] == np.__version__
    assert versions['code'] == code_version()


def _git(folder, *arguments):
    subprocess.run(
        ['git', '-c', 'user.name=n', '-c', 'user.email=e@x', '-C', folder, *arguments],
        check=True, capture_output=True,
    )


@pytest.mark.skipif(shutil.which('git') is None, reason='needs git')
def test_version_of_the_code_is_the_commit_that_last_changed_it(tmp_path):
    def version():
        """Ask a copy of the module, as another process would."""
        program = (
            'import sys; from snca_ros import controller_file as c; '
            f'c.__file__ = {str(tmp_path / "snca_ros" / "controller_file.py")!r}; '
            'print(c.code_version())'
        )
        return subprocess.run(
            [sys.executable, '-c', program], check=True, capture_output=True, text=True,
            cwd=Path(snca_ros.__file__).parents[1],
        ).stdout.strip()

    for name in ('sim_node', 'snca_ros', 'results'):
        (tmp_path / name).mkdir()
        (tmp_path / name / 'a').write_text('1')
    assert version() == snca_ros.__version__
    _git(tmp_path, 'init')
    assert version() == snca_ros.__version__  # no commit yet
    _git(tmp_path, 'add', '.')
    _git(tmp_path, 'commit', '-m', 'one')
    first = version()
    assert re.fullmatch('[0-9a-f]{12}', first)
    (tmp_path / 'results' / 'a').write_text('2')
    (tmp_path / 'snca_ros' / 'new').write_text('')
    assert version() == first
    _git(tmp_path, 'commit', '-am', 'results')
    assert version() == first
    (tmp_path / 'sim_node' / 'a').write_text('2')
    assert version() == f'{first}-dirty'
    _git(tmp_path, 'commit', '-am', 'two')
    assert re.fullmatch('[0-9a-f]{12}', version())
    assert version() != first


def test_same_content_same_bytes(path):
    save_controller(path, make())
    first = path.read_bytes()
    save_controller(path, make())
    assert path.read_bytes() == first


@settings(quick, max_examples=40)
@given(data=st.data())
def test_any_controller_is_kept(tmp_path_factory, data):
    draw = data.draw
    architecture = Architecture(
        draw(st.booleans()), draw(st.booleans()), draw(st.sampled_from(['mlp', 'snn', 'snn-h'])),
        n_c=draw(st.integers(1, 4)),
        hidden=tuple(draw(st.lists(st.integers(1, 9), max_size=3))),
        as_printed=draw(st.booleans()),
    )
    shapes = ['1', 'biped', 'worm-3x2', '111-101-111', 'ball-3', '1101-0111']
    morphology = parse_morphology(draw(st.sampled_from(shapes)))
    theta = np.random.default_rng(draw(st.integers(0, 2**32))).normal(
        size=architecture.n_parameters(morphology.n_voxels)
    )
    special = draw(st.lists(st.floats(allow_nan=False, allow_infinity=False), max_size=5))
    theta[: len(special)] = special[: len(theta)]
    constants = {
        f.name: draw(st.floats(f.metadata['low'], f.metadata['high'])) for f in fields(Material)
    }
    try:
        material = Material(**constants)
    except InvalidInput:  # each in its range, but not together
        reject()
    trained = TrainedController(
        architecture, morphology, theta,
        terrain=draw(st.sampled_from(['flat', 'uphill-10', 'steppy-0.25-20-0'])),
        material=material,
        solver=Solver(draw(st.integers(1, 9)), draw(st.integers(1, 99)), draw(st.booleans())),
        fitness=draw(st.floats()),
        seed=draw(st.integers(0, 2**63 - 1)),
        evaluations=draw(st.integers(0, 10**9)),
        versions=draw(st.dictionaries(st.text(), st.text(), max_size=3)),
    )
    path = tmp_path_factory.mktemp('any') / 'any.npz'
    save_controller(path, trained)
    assert_same(trained, load_controller(path))


# --- damaged files ----------------------------------------------------------------------------


def test_truncated_anywhere(path):
    save_controller(path, make())
    whole = path.read_bytes()
    lengths = [*range(0, len(whole), 5), *range(len(whole) - 64, len(whole))]
    for length in lengths:
        path.write_bytes(whole[:length])
        assert refusal(path).startswith('file: got ')


def test_any_flipped_byte_is_noticed_or_harmless(path):
    trained = make()
    save_controller(path, trained)
    whole = path.read_bytes()
    noticed = 0
    for i in range(len(whole)):
        mask = (0x01, 0x80, 0xFF)[i % 3]
        path.write_bytes(whole[:i] + bytes([whole[i] ^ mask]) + whole[i + 1 :])
        try:
            loaded = load_controller(path)
        except InvalidInput:
            noticed += 1
        else:  # dates, permissions and the like inside the archive
            assert_same(trained, loaded)
    assert noticed > len(whole) * 3 // 4


@pytest.mark.parametrize(
    'begin', [b'', b'PK\x03\x04', b'PK\x05\x06', b'\x93NUMPY\x01\x00', b'\x80\x04']
)
def test_random_bytes(path, begin):
    rng = np.random.default_rng(len(begin))
    for size in (0, 1, 2, 3, 5, 10, 22, 100, 1000, 100_000):
        path.write_bytes(begin + rng.bytes(size))
        assert refusal(path).startswith('file: got ')


@quick
@given(content=st.binary(max_size=300))
def test_any_bytes(tmp_path_factory, content):
    path = tmp_path_factory.mktemp('any') / 'any.npz'
    path.write_bytes(content)
    refusal(path)


@pytest.mark.parametrize(
    'content', [b'', b'hello\n', b'{"theta": []}', b'\x1f\x8b\x08', bytes(512)]
)
def test_other_kinds_of_files(path, content):
    path.write_bytes(content)
    assert 'a controller file (.npz)' in refusal(path)


def test_missing_file(path):
    assert refusal(path).startswith("file: got 'No such file or directory'")


def test_directory(tmp_path):
    assert refusal(tmp_path).startswith("file: got 'Is a directory'")


def test_path_through_a_file(path):
    path.write_bytes(b'')
    assert refusal(path / 'x.npz').startswith("file: got 'Not a directory'")


@pytest.mark.skipif(os.geteuid() == 0, reason='root may read everything')
def test_unreadable_file(path):
    save_controller(path, make())
    path.chmod(0)
    assert refusal(path).startswith("file: got 'Permission denied'")


def test_oversized_file(path):
    save_controller(path, make())
    with path.open('r+b') as file:
        file.truncate(64 * 2**20 + 1)
    assert refusal(path) == f"file: got '{64 * 2**20 + 1} bytes', expected at most {64 * 2**20}"


def test_small_file_of_large_content(path, header):
    # 65 MB of zeros, compressed to less than 0.1 MB.
    zeros = np.zeros(65 * 2**20, dtype=np.uint8)
    np.savez_compressed(path, header=np.array(json.dumps(header)), theta=zeros)
    assert path.stat().st_size < 2**17
    assert 'at most' in refusal(path)


def test_claimed_size_is_not_believed(path, header):
    text, claim = io.BytesIO(), io.BytesIO()
    np.save(text, np.array(json.dumps(header)))
    shape = {'descr': '<f8', 'fortran_order': False, 'shape': (10**13,)}
    np.lib.format.write_array_header_1_0(claim, shape)
    with zipfile.ZipFile(path, 'w') as archive:
        archive.writestr('header.npy', text.getvalue())
        archive.writestr('theta.npy', claim.getvalue() + bytes(117 * 8))
    refusal(path)


def test_single_array(path):
    with path.open('wb') as file:
        np.save(file, THETA)
    assert refusal(path).startswith("file: got 'a single array'")


# --- pickles ----------------------------------------------------------------------------------


class Trap:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


def test_pickle_is_refused_and_not_run(path, tmp_path):
    path.write_bytes(pickle.dumps(Trap(tmp_path / 'mark')))
    assert 'pickle' in refusal(path)
    assert not (tmp_path / 'mark').exists()


@pytest.mark.parametrize('entry', ['header', 'theta'])
def test_pickled_array_is_refused_and_not_run(path, tmp_path, header, entry):
    trap = np.array([Trap(tmp_path / 'mark')] * (1 if entry == 'header' else 117), dtype=object)
    entries = {'header': header, 'theta': THETA, entry: trap}
    write(path, **entries)
    assert 'allow_pickle=False' in refusal(path)
    assert not (tmp_path / 'mark').exists()


# --- theta ------------------------------------------------------------------------------------


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
    assert len(load_controller(path).controller().cells.state.weights) == 3


@pytest.mark.parametrize('index', [0, 5, 116])
@pytest.mark.parametrize('value', [np.nan, np.inf, -np.inf])
def test_first_theta_that_is_not_finite_is_named(path, header, index, value):
    theta = THETA.copy()
    theta[index] = theta[-1] = value
    write(path, header, theta)
    assert refusal(path) == f'theta[{index}]: got {value}, expected a finite number'


# --- the header -------------------------------------------------------------------------------


def changed(header: dict, field: str, value) -> dict:
    """Return a copy of `header` with `value` in `field`, such as 'solver.substeps'."""
    name, _, rest = field.partition('.')
    return {**header, name: changed(header.get(name, {}), rest, value) if rest else value}


NOT_A_DICT = [None, True, 3, 'text', [], ['uniform']]
NOT_A_SIZE = [None, 0, -1, 1.0, '1', True, [1], {}, 10**30]
WRONG = {
    'format_version': [None, '1', 1.0, True, [1], {}, 0, 2, -1, 10**30],
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
    'v_x': [None, 1.0, 'text', [], {'pymunk': '1'}, {'pymunk': None}, {'bullet': 1.0}],
}
SINCE_TWO_ENGINES = ('chosen_by', 'v_x')  # older files have none
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
        assert words[0] in refusal(path).split(': got ')[0], f'{field} = {value!r}'


def test_every_field_has_its_wrong_values(header):
    nested = ('architecture', 'morphology', 'material', 'solver')
    names = {*header, *(f'{name}.{key}' for name in nested for key in header[name])}
    assert names == set(WRONG)


@pytest.mark.parametrize(
    'field', [f for f in WRONG if '.' not in f and f not in SINCE_TWO_ENGINES]
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


# --- saving that fails ------------------------------------------------------------------------


@pytest.mark.parametrize('old', [None, b'the old content'])
@pytest.mark.parametrize('error', [OSError(errno.ENOSPC, 'No space'), KeyboardInterrupt()])
@pytest.mark.parametrize('when', ['writing', 'flushing'])
def test_failing_save_leaves_no_half_file(path, monkeypatch, old, error, when):
    if old is not None:
        path.write_bytes(old)

    def fail(*args, **kwargs):
        if when == 'writing':
            args[0].write(b'PK\x03\x04 half of')
        raise error

    where, name = {
        'writing': (snca_ros.controller_file.np, 'savez_compressed'), 'flushing': (os, 'fsync')
    }[when]
    monkeypatch.setattr(where, name, fail)
    with pytest.raises(type(error)):
        save_controller(path, make())
    assert [p.name for p in path.parent.iterdir()] == ([] if old is None else [path.name])
    assert old is None or path.read_bytes() == old


def test_what_cannot_be_written_leaves_nothing(path):
    with pytest.raises(TypeError):
        save_controller(path, make(versions={'numpy': object()}))
    assert list(path.parent.iterdir()) == []


def test_files_from_before_there_were_two_engines(path, header):
    old = {key: value for key, value in header.items() if key not in SINCE_TWO_ENGINES}
    write(path, old, THETA)
    trained = load_controller(path)
    assert (trained.chosen_by, trained.v_x) == ('pymunk', {})
