"""Controller files: what goes in comes out, and saving that fails leaves nothing."""

import errno
import os
import re
import shutil
import subprocess
import sys
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st
from support.controller_files import assert_same, make, quick

import snca_ros.controller_file
from sim_node.errors import InvalidInput
from sim_node.model.material import Material
from sim_node.model.morphology import parse_morphology
from sim_node.model.solver import Solver
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import load_controller, save_controller
from snca_ros.evolution.episode_set import EpisodeSet
from snca_ros.trained_controller import TrainedController
from snca_ros.versions import code_version

NINE = [(name, model) for name in ('U-nD', 'U-D', 'nU-D') for model in ('mlp', 'snn', 'snn-h')]


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


def test_the_set_of_episodes_is_kept(path):
    episodes = EpisodeSet('11,worm', 'flat,uphill-10', 'loss=0..0.5;none', draw=8, score='minimum')
    trained = make(fitness=6.1, episode_set=episodes, n_episodes=32)
    save_controller(path, trained)
    assert_same(trained, load_controller(path))
    assert trained.achieved == 'minimum v_x 6.100 m/s over 32 episodes'
    assert 'minimum v_x 6.100 m/s over 32 episodes' in repr(trained)
    one = make(fitness=6.1, episode_set=EpisodeSet(starts=1))
    assert one.achieved == 'mean v_x 6.100 m/s over 1 episode'


def test_a_file_of_one_plain_episode_does_not_mention_sets(path):
    save_controller(path, make(fitness=6.1))
    with np.load(path, allow_pickle=False) as data:
        assert 'episode_set' not in data['header'].item()
    assert make(fitness=6.1).achieved == 'v_x 6.100 m/s'


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
            'import sys; from snca_ros import versions as c; '
            f'c.__file__ = {str(tmp_path / "snca_ros" / "versions.py")!r}; '
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
