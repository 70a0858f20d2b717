"""`import snca_ros`: what it offers, what it loads, and that it is what the commands do."""

import argparse
import ast
import inspect
import json
import os
import subprocess
import sys
from concurrent.futures import BrokenExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from support.limits import LIMIT
from support.paths import ROOT
from support.synthetic_bag import Walk, messages_of_walk, write_messages

import snca_ros as snca
from sim_node.model.material import Material
from sim_node.model.morphology import parse_morphology
from sim_node.simulation import Diverged, Simulation
from snca_ros import cli
from snca_ros.api.processes import worker_processes
from snca_ros.cell.architecture import Architecture
from snca_ros.commands.evolve import add_arguments
from snca_ros.controller_file import load_controller
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import Episode, run_episode
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.workers import IN_PROCESS
from snca_ros.faults import parse_faults
from snca_ros.recording.episode import RECORDABLE
from snca_ros.trained_controller import TrainedController

ENVIRONMENT = {**os.environ, 'PYTHONPATH': str(ROOT)}
FAULTS = 'loss=0.3,delay=1,death=0.5@0.5,broken_sensors=random:0.3,broken_actuators=frozen:0.3'
TINY = {'episodes': 10, 'population': 4, 'duration': 0.5, 'transient': 0.1}


def make_robot(model='snn-h', **options):
    architecture = Architecture.named('U-D', model)
    theta = np.random.default_rng(0).uniform(-1, 1, architecture.n_parameters(3))
    trained = TrainedController(architecture, parse_morphology('11-10'), theta, **options)
    return snca.Robot(trained, 'mine')


def python(*arguments, **options):
    return subprocess.run(
        [sys.executable, *arguments], check=False, env=ENVIRONMENT, capture_output=True, text=True,
        timeout=LIMIT, **options,
    )


def test_the_import_loads_nothing_that_takes_time():
    found = python('-X', 'importtime', '-c', 'import snca_ros')
    assert found.returncode == 0
    loaded = {line.rpartition('|')[2].strip().partition('.')[0]
              for line in found.stderr.splitlines()}
    assert 'snca_ros' in loaded
    assert not loaded & {'numba', 'matplotlib', 'rclpy', 'scipy', 'pymunk', 'numpy', 'rosbags'}


def test_using_the_robot_loads_no_drawing():
    found = python('-c', 'import snca_ros, sys; snca_ros.load; snca_ros.evolve; snca_ros.assess\n'
                   'snca_ros.read_bag; print(sorted({"matplotlib", "rclpy"} & set(sys.modules)))')
    assert found.stdout == '[]\n', found.stderr


def test_a_controller_file_needs_no_engine():
    """Voxel nodes, which have no body, load it."""
    found = python('-c', 'import snca_ros.controller_file, sys; print("pymunk" in sys.modules)')
    assert found.stdout == 'False\n', found.stderr


def test_a_robot_in_another_body_is_run_saved_and_assessed(tmp_path):
    robot = make_robot()
    other = robot.in_body('comb-5x2')
    assert (other.name, other.morphology.n_voxels) == ('mine in comb-5x2', 8)
    damaged = other.without('voxel_1_1', 'voxel_0_1', 'voxel_0_0')
    assert damaged.name == 'mine in comb-5x2 without voxel_1_1, voxel_0_1, voxel_0_0'
    assert damaged.morphology.voxel_names == (
        'voxel_2_0', 'voxel_4_0', 'voxel_2_1', 'voxel_3_1', 'voxel_4_1'
    )
    episode = damaged.run(1.0, record='actuation')
    assert episode.voxel_names == damaged.morphology.voxel_names
    np.testing.assert_array_equal(episode.centers, run_episode(
        Simulation('xx111-x0101'), damaged.trained.controller(), 1.0
    ).centers)
    damaged.save(tmp_path / 'damaged.npz')
    again = snca.load(tmp_path / 'damaged.npz')
    np.testing.assert_array_equal(again.run(1.0).centers, episode.centers)
    assert 'evolved as 11-10 on flat' in repr(again)
    assert robot.in_body('11-10') is robot
    assert robot.without() is robot
    scores = snca.assess([robot, other], 'flat', duration=6.0)
    assert scores.coords['robot'] == ('mine', 'mine in comb-5x2')
    with pytest.raises(snca.InvalidInput, match='one connected piece'):
        other.without('voxel_1_1')


def test_every_name_is_there_and_hides_no_module():
    assert set(snca.__all__) <= set(dir(snca))
    listed = [name for names in snca._MODULES.values() for name in names]
    assert sorted(listed) == snca.__all__ == sorted(snca.__all__)
    for name in snca.__all__:
        assert getattr(snca, name).__doc__
        assert not (ROOT / 'snca_ros' / name).exists()
        assert not (ROOT / 'snca_ros' / f'{name}.py').exists()
    with pytest.raises(AttributeError, match="no attribute 'laod'"):
        snca.laod  # noqa: B018


def test_type_checkers_see_the_same_names():
    tree = ast.parse((ROOT / 'snca_ros' / '__init__.py').read_text())
    (checked,) = (node for node in tree.body if isinstance(node, ast.If))
    seen = {
        node.module: tuple(alias.name for alias in node.names)
        for node in checked.body if isinstance(node, ast.ImportFrom)
    }
    assert seen == snca._MODULES
    assert (ROOT / 'snca_ros' / 'py.typed').exists()


@pytest.mark.parametrize('engine', ['pymunk', 'batched'])
@pytest.mark.parametrize('faults', ['', FAULTS])
@pytest.mark.parametrize('model', ['snn-h', 'mlp'])
def test_an_episode_is_the_offline_one_whatever_is_recorded(model, faults, engine):
    robot = make_robot(model, terrain='hilly-1-10-0', material=Material(friction=0.7))
    call = {'faults': faults, 'engine': engine, 'push': 3}
    trained, wrong = robot.trained, parse_faults(faults)
    simulation = Simulation(
        trained.morphology, 'hilly-1-10-0', material=trained.material, engine=engine, push=3,
        **wrong.of_body,
    )
    expected = run_episode(simulation, trained.controller(wrong), 1.0)
    bare, full = robot.run(1.0, **call), robot.run(1.0, record='all', **call)
    np.testing.assert_array_equal(bare.centers, expected.centers)
    np.testing.assert_array_equal(full.centers, expected.centers)
    assert bare.v_x == full.v_x == expected.velocity()
    assert robot.run(1.0, terrain='flat', **call).v_x != bare.v_x


@pytest.mark.parametrize('model', ['snn', 'mlp'])
def test_arrays_of_an_episode(model):
    episode = make_robot(model).run(0.5, record='all')
    np.testing.assert_allclose(episode.times, np.linspace(0.0, 0.5, 31))
    assert episode.centers.shape == (31, 2)
    assert episode.readings.shape == (31, 3, 4)
    assert episode.corners.shape == (31, 3, 4, 2)
    assert episode.actuation.shape == episode.heard.shape == (30, 3)
    np.testing.assert_allclose(episode.corners[0].mean(axis=(0, 1)), episode.centers[0])
    for name in RECORDABLE:
        array = getattr(episode, name)
        assert array is None or np.isfinite(array).all(), name
    if model == 'mlp':
        assert episode.values.shape == (30, 3, 4)
        assert episode.spikes is episode.thresholds is None
    else:
        assert episode.spikes.shape == (30, 3, 4, 16)
        assert episode.spikes.dtype == np.uint8
        assert episode.thresholds.shape == (30, 3)
        assert episode.values is None


def test_what_was_not_recorded_is_told():
    episode = make_robot().run(0.1, record=['spikes'])
    assert episode.spikes.shape[0] == 6
    with pytest.raises(snca.InvalidInput, match=r"record: got .'spikes',., expected 'readings'"):
        episode.readings  # noqa: B018


@pytest.mark.parametrize('record', [(), 'all'])
def test_a_diverged_episode_ends_early_and_scores_nothing(record, monkeypatch):
    robot = make_robot()
    if record:
        real = Simulation.step

        def step(self, actuation):
            if self.step_count == 12:
                self.world.masses[:] = np.nan
                raise Diverged('far')
            return real(self, actuation)

        monkeypatch.setattr(Simulation, 'step', step)
    else:
        monkeypatch.setattr(
            'snca_ros.recording.offline.run_episode',
            lambda *args: Episode(np.zeros((13, 2)), diverged=True),
        )
    episode = robot.run(1.0, record)
    assert episode.diverged
    assert episode.v_x == -np.inf
    assert len(episode.times) == len(episode.centers) == 13
    if record:
        assert len(episode.readings) == len(episode.corners) == 13
        assert len(episode.actuation) == len(episode.spikes) == len(episode.thresholds) == 12
        assert np.isfinite(episode.centers).all()
    assert 'diverged' in repr(episode)


@pytest.mark.parametrize(('call', 'text'), [
    ({'duration': 0.0}, 'duration: got 0.0, expected seconds from 1/60 to 3600'),
    ({'duration': True}, 'duration: got True'),
    ({'duration': '10'}, "duration: got '10'"),
    ({'record': 'spike'}, "record: got 'spike', .*did you mean 'spikes'"),
    ({'record': ['readings', 1]}, 'record: got 1'),
    ({'terrain': 'hily-1-10-0'}, "terrain: got 'hily-1-10-0'"),
    ({'faults': 'los=1'}, "faults: got 'los', .*did you mean 'loss'"),
    ({'faults': 3}, 'faults: got 3'),
    ({'engine': 'box2d'}, "engine: got 'box2d'"),
    ({'push': -1}, 'push: got -1'),
])
def test_bad_arguments_of_run(call, text):
    with pytest.raises(snca.InvalidInput, match=text):
        make_robot().run(**{'duration': 0.1, **call})


def test_load_and_save(tmp_path):
    robot = snca.load('biped-U-nD-snn-h')
    robot.save(tmp_path / 'copy.npz')
    copy = snca.load(tmp_path / 'copy.npz')
    assert copy.name == 'copy'
    np.testing.assert_array_equal(copy.parameters, robot.parameters)
    assert replace(copy.trained, parameters=robot.parameters) == robot.trained
    with pytest.raises(snca.InvalidInput, match="did you mean 'biped-U-nD-snn-h'"):
        snca.load('biped-U-nD-snn')
    with pytest.raises(snca.InvalidInput, match='a file that can be written'):
        robot.save(tmp_path / 'nowhere' / 'copy.npz')


def test_reprs_are_one_short_line(tmp_path):
    robot = snca.load('biped-U-nD-snn-h')
    episode = robot.run(0.5, record='all')
    recording = snca.read_bag(bag_of(episode, tmp_path / 'bag'))
    scores = snca.assess(robot, terrains='flat', duration=6.0)
    for thing in (robot, robot.trained, robot.morphology, episode, recording, scores):
        assert '\n' not in repr(thing)
        assert len(repr(thing)) < 250 + len(str(tmp_path))
    assert repr(robot).startswith("Robot('biped-U-nD-snn-h': biped, 10 voxels, U-nD snn-h, evolved")
    assert 'biped, 10 voxels, 31 steps, 0.5 s, v_x ' in repr(recording)
    assert repr(scores).startswith('Scores(robot 1, faults 1, terrain 1, start 1: v_x ')


def bag_of(episode, path):
    walk = Walk(
        episode.voxel_names, episode.centers, episode.readings[:-1], episode.actuation,
        episode.spikes,
    )
    return write_messages(path, messages_of_walk(walk))


def test_a_recording_has_the_names_and_the_gait_of_its_episode(tmp_path):
    episode = snca.load('biped-U-nD-snn-h').run(7.0, record=('readings', 'actuation', 'spikes'))
    recording = snca.read_bag(bag_of(episode, tmp_path / 'bag'))
    np.testing.assert_array_equal(recording.times, episode.times)
    np.testing.assert_array_equal(recording.centers, episode.centers)
    for name in ('readings', 'actuation', 'spikes', 'heard'):
        n = len(episode.actuation)
        np.testing.assert_array_equal(getattr(recording, name)[:n], getattr(episode, name)[:n])
    assert recording.v_x == episode.v_x
    of_bag, of_episode = snca.measure_gait(recording), snca.measure_gait(episode)
    assert of_bag.velocity == of_episode.velocity == episode.v_x
    assert of_bag.frequency == of_episode.frequency
    np.testing.assert_array_equal(of_bag.firing_rates, of_episode.firing_rates)


def test_evolve_is_the_command(tmp_path):
    seen = []
    run = snca.evolve('11-10', 'U-D', 'mlp', seed=2, run=tmp_path / 'a', report=seen.append, **TINY)
    config = RunConfig('11-10', Architecture.named('U-D', 'mlp'), seed=2, **TINY)
    folder = RunFolder.create(tmp_path / 'b', config)
    progress = evolve(folder, IN_PROCESS)
    folder.close()
    assert run.config == config
    for name in ('history.csv', 'config.yaml'):
        assert (tmp_path / 'a' / name).read_bytes() == (tmp_path / 'b' / name).read_bytes()
    np.testing.assert_array_equal([tuple(row) for row in run.history], progress.history)
    assert [len(now.history) for now in seen] == [1, 2, 3]
    assert run.history['episodes'].tolist() == [4, 7, 10]
    best = run.best.trained.fitness
    assert best == run.history['best_so_far'][-1]
    assert run.best.name == 'a'
    np.testing.assert_array_equal(
        run.best.parameters, load_controller(tmp_path / 'b' / 'best.npz').parameters
    )
    np.testing.assert_array_equal(snca.load(tmp_path / 'a').parameters, run.best.parameters)
    assert repr(run).endswith(f', 10 of 10 episodes, best v_x {best:.3f} m/s)')


def test_evolve_on_a_set_is_the_command(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / 'faults.yaml').write_text('loss: 0.3\nseed: 4\n')
    run = snca.evolve(
        ['11', '11-10'], 'U-D', 'mlp', terrain=['flat', 'uphill-10'],
        faults=['none', 'faults.yaml', snca.Faults(delay=1)], starts=1, score='minimum',
        run=tmp_path / 'a', **{**TINY, 'episodes': 60},
    )
    assert run.config.episode_set.n_episodes == 12
    assert run.config.faults == 'none;loss=0.3,seed=4;delay=1'
    assert run.history['episodes'].tolist() == [48, 60]
    assert repr(run).endswith(
        f'60 of 60 episodes, best minimum v_x {run.best.trained.fitness:.3f} m/s over 12 episodes)'
    )
    command = (
        'evolve --shape 11,11-10 --architecture U-D --neuron-model mlp --terrain flat,uphill-10 '
        '--faults none --faults faults.yaml --faults delay=1 --starts 1 --score minimum '
        '--episodes 60 --population 4 --duration 0.5 --transient 0.1 --workers 1 --run b'
    )
    assert cli.main([*command.split(), '--json', 'b.json']) == 0
    out, err = capsys.readouterr()
    assert '11, 11-10 on flat, uphill-10, faults none; loss=0.3,seed=4; delay=1, starts 1' in err
    assert 'starts 1 to 1, minimum of 12 episodes per candidate, U-D mlp' in err
    assert 'minimum v_x ' in out
    assert ', over 12 episodes each (chosen by pymunk), 60 episodes\n' in out
    for name in ('history.csv', 'config.yaml', 'best.npz'):
        assert (tmp_path / 'a' / name).read_bytes() == (tmp_path / 'b' / name).read_bytes()
    found = json.loads((tmp_path / 'b.json').read_text())
    assert (found['score'], found['episodes'], found['episodes_of_score']) == ('minimum', 60, 12)


def test_the_former_name_of_the_budget_still_works(tmp_path, capsys):
    call = {'shape': '11', 'neuron_model': 'mlp', **TINY}
    run = snca.evolve(**call, run=tmp_path / 'a')
    del call['episodes']
    with pytest.warns(DeprecationWarning, match='evaluations is now episodes'):
        again = snca.evolve(**call, evaluations=10, run=tmp_path / 'a', resume=True)
    np.testing.assert_array_equal(again.history, run.history)
    with (
        pytest.warns(DeprecationWarning, match='episodes'),
        pytest.raises(snca.InvalidInput, match='alone'),
    ):
        snca.evolve(**call, evaluations=10, episodes=10, run=tmp_path / 'b')
    command = ['evolve', '--shape', 'bipd', '--evaluations', '10']
    assert cli.main(command) == 2
    err = capsys.readouterr().err
    assert 'snca evolve: warning: --evaluations is now --episodes\n' in err


def test_an_interrupted_run_goes_on(tmp_path):
    call = {'shape': '11', 'neuron_model': 'mlp', **TINY}

    def stop(now):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        snca.evolve(**call, run=tmp_path / 'a', report=stop)
    with pytest.raises(snca.InvalidInput, match='or resume=True'):
        snca.evolve(**call, run=tmp_path / 'a')
    with pytest.raises(snca.InvalidInput, match=r'seed9.*the run of the other arguments'):
        snca.evolve(**call, run=tmp_path / 'a', resume=True, seed=9)
    run = snca.evolve(run=str(tmp_path / 'a'), resume=True)
    whole = snca.evolve(**call, run=tmp_path / 'b', resume=True)  # there is none to go on with
    np.testing.assert_array_equal(run.history, whole.history)
    again = snca.evolve(**call, run=tmp_path / 'a', resume=True)
    np.testing.assert_array_equal(again.best.parameters, whole.best.parameters)


def test_a_run_has_a_folder_of_its_own(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    run = snca.evolve('11', neuron_model='mlp', **TINY)
    assert run.path == Path('runs') / run.config.name
    assert (run.path / 'best.npz').exists()


def test_all_options_of_the_command_are_arguments():
    parser = argparse.ArgumentParser()
    add_arguments(parser)
    options = {action.dest for action in parser._actions} - {'help', 'scheduler', 'json'}
    assert options <= set(inspect.signature(snca.evolve).parameters)


@pytest.mark.parametrize(('call', 'text'), [
    ({'shape': 'tripot'}, "did you mean 'tripod'"),
    ({'neuron_model': 'snn-x'}, 'neuron_model'),
    ({'episodes': 0}, 'episodes: got 0'),
    ({'workers': 0}, 'workers: got 0, expected an integer from 1'),
    ({'strategy': 'cmaes'}, 'strategy'),
])
def test_bad_arguments_of_evolve_leave_no_folder(tmp_path, call, text):
    with pytest.raises(snca.InvalidInput, match=text):
        snca.evolve(**call, run=tmp_path / 'run')
    assert not (tmp_path / 'run').exists()


def test_assess_scores_episodes():
    robots = make_robot('mlp'), replace(make_robot(), name='other')
    scores = snca.assess(
        robots, ['flat', 'uphill-10'], 1, ['', 'loss=0..0.5', snca.Faults(delay=2)], duration=5.5
    )
    names = scores.coords['faults']
    assert scores.v_x.shape == (2, 13, 2, 2) == np.asarray(scores).shape
    assert names[:3] == ('', 'loss=0', 'loss=0.05')
    assert scores.coords['robot'] == ('mine', 'other')
    episode = robots[1].run(5.5, terrain='uphill-10', faults='loss=0.05,seed=1', push=1)
    found = scores.sel(robot='other', terrain='uphill-10', faults='loss=0.05', start=1)
    assert found == episode.v_x
    assert scores.sel(terrain='flat').shape == (2, 13, 2)
    np.testing.assert_array_equal(scores.v_x[:, 0], scores.v_x[:, 1])
    with pytest.raises(snca.InvalidInput, match="terrain: got 'hilly', expected one of 'flat'"):
        scores.sel(terrain='hilly')
    with pytest.raises(snca.InvalidInput, match="did you mean 'terrain'"):
        scores.sel(terrains='flat')


def test_defaults_of_assess_are_those_of_the_command(monkeypatch):
    seen = []
    monkeypatch.setattr(
        'snca_ros.api.assessment.run_trials',
        lambda workers, trials: (
            seen.append(trials) or np.zeros(len(trials)), np.full((len(trials), 2), np.nan)
        ),
    )
    scores = snca.assess('biped-U-nD-snn-h')
    assert scores.v_x.shape == (1, 1, 16, 1)
    assert snca.assess('biped-U-nD-snn-h', faults='loss=0.5').v_x.shape == (1, 1, 1, 10)
    assert {trial.duration for trials in seen for trial in trials} == {30.0}


@pytest.mark.parametrize(('call', 'text'), [
    ({'terrains': 'flt'}, 'terrain: got'),
    ({'terrains': []}, 'terrains: got .*at least one'),
    ({'robots': []}, 'robots: got .*at least one'),
    ({'starts': -1}, 'starts: got -1'),
    ({'starts': 1.5}, 'starts: got 1.5'),
    ({'duration': 5.0}, 'duration: got 5.0'),
    ({'faults': 'loss=0..2..0.5'}, 'loss: got 1.5'),
    ({'engine': 'x'}, 'engine'),
    ({'workers': True}, 'workers: got True'),
])
def test_bad_arguments_of_assess(call, text):
    with pytest.raises(snca.InvalidInput, match=text):
        snca.assess(**{'robots': 'biped-U-nD-snn-h', **call})


SCRIPT = """
import snca_ros as snca
robot = snca.load('biped-U-D-mlp')
call = {'terrains': 'flat', 'duration': 5.1, 'workers': 2}
"""


def test_a_script_without_a_guard_is_told_what_to_do(tmp_path):
    script = tmp_path / 'script.py'
    script.write_text(f'{SCRIPT}\nsnca.assess(robot, **call)\n')
    found = python(str(script), cwd=tmp_path)
    assert found.returncode == 1
    assert found.stderr.rstrip().endswith('workers=1 needs no other process.')
    assert "below `if __name__ == '__main__':`" in found.stderr


def test_workers_change_nothing_in_a_script_with_a_guard_or_a_notebook(tmp_path):
    alone = snca.assess('biped-U-D-mlp', terrains='flat', duration=5.1).v_x.item()
    script = tmp_path / 'script.py'
    script.write_text(
        f"{SCRIPT}\nif __name__ == '__main__':\n    print(snca.assess(robot, **call).v_x.item())\n"
    )
    found = python(str(script), cwd=tmp_path)
    assert found.stdout == f'{alone!r}\n', found.stderr
    # As a cell of a notebook: the main module is no file.
    found = python('-c', f'{SCRIPT}\nprint(snca.assess(robot, **call).v_x.item())', cwd=tmp_path)
    assert found.stdout == f'{alone!r}\n', found.stderr


def test_a_worker_that_is_killed_is_told():
    with pytest.raises(BrokenExecutor, match='too little memory'), \
            worker_processes(2) as workers:
        workers.executor.submit(os._exit, 3).result()
