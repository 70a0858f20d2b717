"""Tasks that live outside the tree plug in by name, and no file is touched for them."""

import csv
import inspect
import os
import shutil
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
import yaml
from support.evolve import ROOT, assert_same_run
from support.limits import LIMIT

import snca_ros as snca
from sim_node.batched.engine import Robots
from sim_node.errors import InvalidInput
from sim_node.model.material import Material
from sim_node.model.solver import Solver
from sim_node.model.work import make_work_meter, measure_work
from sim_node.simulation import Simulation
from snca_ros import cli
from snca_ros.assessment.fault_sweep import parse_sweep
from snca_ros.assessment.figures import draw_scores, draw_sweeps
from snca_ros.assessment.trials import Trial, score
from snca_ros.campaign.endpoints import perform
from snca_ros.campaign.specification import read_campaign
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller
from snca_ros.controller_file import load_controller, save_controller
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import run_compiled, run_episode, run_step_by_step
from snca_ros.evolution.episode_lanes import run_episodes
from snca_ros.evolution.evaluator import evaluate
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.history import read_history
from snca_ros.evolution.tasks import RECORDS, TASKS, Episode, Task, check_task, score_of
from snca_ros.evolution.workers import IN_PROCESS, local_workers
from snca_ros.faults import parse_faults
from snca_ros.trained_controller import TrainedController


class Leap(Task):
    """The highest rise of the centre of mass above an earlier low, after the transient."""

    quantity, unit = 'rise', 'm'

    def score(self, episode, transient):
        """Return the rise [m]."""
        y = episode.centers[round(60 * transient):, 1]
        return (y - np.minimum.accumulate(y)).max()


class Hover(Task):
    """The share of voxels that do not touch the ground, after the transient."""

    quantity, unit, records = 'airborne', '', ('touching', 'actuation')

    def score(self, episode, transient):
        """Return the share, plus a millionth of the mean effort so that scores differ."""
        first = round(60 * transient)
        effort = abs(episode.records['actuation'][first:]).mean()
        return 1.0 - episode.records['touching'][first:].mean() + 1e-6 * effort


@pytest.fixture(autouse=True)
def tasks():
    TASKS.register('leap', Leap())
    TASKS.register('hover', Hover())
    yield
    del TASKS['leap'], TASKS['hover']


CONFIG = RunConfig(
    '11-10', Architecture.named('U-D', 'mlp'), episodes=11, population=4, duration=1.0,
    transient=0.2,
)
OPTIONS = (
    '--shape', '11-10', '--architecture', 'U-D', '--neuron-model', 'mlp', '--episodes', '11',
    '--population', '4', '--duration', '1', '--transient', '0.2',
)


def parameters_of(morphology, n=1, seed=0, architecture=CONFIG.architecture):
    size = architecture.n_parameters(morphology.n_voxels)
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (n, size))


def evolved(path, config):
    folder = RunFolder.create(path, config)
    try:
        return evolve(folder, IN_PROCESS)
    finally:
        folder.close()


# --- what is recorded -------------------------------------------------------------------------


def loop(simulation, controller, n_steps):
    """Return centres and records of the episode that anybody would write."""
    controller.reset()
    readings, centers = simulation.reset(), [simulation.center]
    rows = {name: [] for name in RECORDS}
    meter = make_work_meter(simulation.morphology, simulation.material)

    def work():
        masses, actuation = simulation.world.masses, simulation.world.actuation
        measure_work(meter, masses[..., None].copy(), actuation[..., None].copy())
        return meter.work[:, 0]

    work()
    for _ in range(n_steps):
        readings = simulation.step(controller.step(readings))
        centers.append(simulation.center)
        for name in RECORDS:
            row = work() if name == 'work' else getattr(simulation.world, name)
            rows[name].append(row.copy())
    return np.array(centers), {name: np.array(row) for name, row in rows.items()}


def assert_records(episode, rows, names):
    assert tuple(episode.records) == names
    for name in names:
        np.testing.assert_array_equal(episode.records[name], rows[name], strict=True)


@pytest.mark.parametrize(
    'names', [RECORDS, ('touching',), ('work',), ('area_ratios', 'actuation')]
)
@pytest.mark.parametrize('text', ['', 'broken_actuators=frozen:0.5@0.5,sensor_noise=0.05,seed=2'])
@pytest.mark.parametrize('engine', ['pymunk', 'batched'])
def test_episodes_record_the_bits_of_the_loop(engine, text, names):
    faults = parse_faults(text)
    simulation = Simulation('biped', 'hilly-0.5-10-0', engine=engine, **faults.of_body)
    parameters = parameters_of(simulation.morphology, seed=3)[0]
    controller = Controller(CONFIG.architecture, simulation.morphology, parameters, faults)
    centers, rows = loop(simulation, controller, 90)
    for name in RECORDS:
        assert len(np.unique(rows[name])) > 1  # none is constant
    assert {*np.unique(rows['touching'])} == {0.0, 1.0}
    run = run_compiled if engine == 'pymunk' else run_step_by_step
    for runner in (run, run_step_by_step):
        episode = runner(simulation, controller, 90, names)
        np.testing.assert_array_equal(episode.centers, centers)
        assert_records(episode, rows, names)
        bare = runner(simulation, controller, 90)
        assert bare.records == {}
        np.testing.assert_array_equal(bare.centers, centers)


@pytest.mark.parametrize('names', [RECORDS, ('touching',), ('work',)])
@pytest.mark.parametrize('width', [4, 16])
def test_lanes_record_the_bits_of_a_robot_alone(width, names):
    simulation = Simulation('biped', 'hilly-0.5-10-0', engine='batched')
    morphology = simulation.morphology
    robots = Robots(
        morphology, simulation.terrain, simulation.material, simulation.solver, width
    )
    several = parameters_of(morphology, 3, seed=3)
    together = run_episodes(
        robots, CONFIG.architecture, morphology, several, 1.5, records=names
    )
    bare = run_episodes(robots, CONFIG.architecture, morphology, several, 1.5)
    for parameters, episode, other in zip(several, together, bare, strict=True):
        controller = Controller(CONFIG.architecture, morphology, parameters)
        centers, rows = loop(simulation, controller, 90)
        assert_records(episode, rows, names)
        np.testing.assert_array_equal(episode.centers, centers)
        np.testing.assert_array_equal(other.centers, centers)
        assert other.records == {}


@pytest.mark.parametrize('runner', ['step by step', 'compiled', 'lanes'])
def test_records_end_where_the_physics_diverges(runner):
    wild = {'material': Material(frequency=30.0, damping_ratio=0.0),
            'solver': Solver(physics='first')}
    engine = 'batched' if runner == 'lanes' else 'pymunk'
    simulation = Simulation('worm-2x1', engine=engine, **wild)
    parameters = 2.0 * parameters_of(simulation.morphology)
    if runner == 'lanes':
        robots = Robots(
            simulation.morphology, simulation.terrain, simulation.material, simulation.solver, 4
        )
        episode, = run_episodes(
            robots, CONFIG.architecture, simulation.morphology, parameters, 30.0, records=RECORDS
        )
    else:
        controller = Controller(CONFIG.architecture, simulation.morphology, parameters[0])
        run = run_compiled if runner == 'compiled' else run_step_by_step
        episode = run(simulation, controller, 1800, RECORDS)
    n_steps = len(episode.centers) - 1
    assert episode.diverged
    assert 0 < n_steps < 1800
    for array in episode.records.values():
        assert array.shape == (n_steps, 2)
        assert np.isfinite(array).all()
    assert [score_of(TASKS[name], episode, 0.0).score for name in TASKS] == [-np.inf] * len(TASKS)


def test_unknown_records_are_refused_before_there_is_a_run():
    class Wrong(Leap):
        records = ('touching', 'colour')

    simulation = Simulation('11-10')
    own = Controller(
        CONFIG.architecture, simulation.morphology, parameters_of(simulation.morphology)[0]
    )
    expected = f"got 'colour', expected one of {', '.join(RECORDS)}"
    with pytest.raises(InvalidInput, match=f'records: {expected}'):
        run_episode(simulation, own, 0.1, ('colour',))
    TASKS.register('wrong', Wrong())
    try:
        with pytest.raises(InvalidInput, match=f'records of task wrong: {expected}'):
            replace(CONFIG, task='wrong')
    finally:
        del TASKS['wrong']


def test_a_score_that_cannot_be_compared_is_refused():
    class Broken(Leap):
        def score(self, episode, transient):
            return np.nan

    episode = Episode(np.zeros((3, 2)), diverged=False)
    with pytest.raises(InvalidInput, match=r'Broken\.score: got nan, expected a number, rise of'):
        score_of(Broken(), episode, 0.0)


def test_labels():
    assert [TASKS[name].label for name in ('walk', 'leap', 'hover')] == [
        'v_x [m/s]', 'rise [m]', 'airborne'
    ]
    assert [TASKS[name].in_unit(0.12345) for name in ('walk', 'leap', 'hover')] == [
        '0.123 m/s', '0.123 m', '0.123'
    ]
    assert TASKS['walk'].in_unit(2.0, 1) == '2.0 m/s'


# --- evolution --------------------------------------------------------------------------------


@pytest.mark.parametrize('task', ['walk', 'leap', 'hover'])
@pytest.mark.parametrize('engine', ['pymunk', 'batched'])
def test_a_task_evolves_is_saved_loaded_and_assessed(engine, task, tmp_path):
    config = replace(CONFIG, engine=engine, task=task)
    progress = evolved(tmp_path / 'run', config)
    trained = load_controller(tmp_path / 'run' / 'best.npz')
    assert (trained.task, set(trained.scores)) == (task, {'pymunk', 'batched'})
    for name, found in trained.scores.items():
        simulation = replace(config, engine=name).simulation()
        centers, rows = loop(simulation, trained.controller(), 60)
        kept = {record: rows[record] for record in TASKS[task].records}
        expected = TASKS[task].score(Episode(centers, False, records=kept), 0.2)
        assert found == expected
        assert score(Trial(trained, 'flat', name, duration=1.0, transient=0.2)).score == expected
    assert trained.fitness == trained.scores[engine] == progress.history[-1][-1]
    assert len({row[2:5] for row in progress.history}) == len(progress.history) == 4
    assert RunConfig.from_yaml(tmp_path / 'run' / 'config.yaml') == config
    save_controller(tmp_path / 'again.npz', trained)
    assert load_controller(tmp_path / 'again.npz').task == task


def test_the_task_decides_which_robot_is_the_best():
    several = parameters_of(CONFIG.simulation().morphology, 20)
    scored = {
        task: list(evaluate(IN_PROCESS, replace(CONFIG, task=task), several))
        for task in ('walk', 'leap', 'hover')
    }
    order = {
        task: np.argsort([one.score for one in found]).tolist() for task, found in scored.items()
    }
    assert order['walk'] != order['leap'] != order['hover'] != order['walk']


@pytest.fixture(scope='module')
def plugin(tmp_path_factory):
    """Return a folder with a module of both tasks, for other processes."""
    folder = tmp_path_factory.mktemp('plugin')
    lines = [
        'import numpy as np',
        'from snca_ros.evolution.tasks import TASKS, Task', inspect.getsource(Leap),
        inspect.getsource(Hover), "TASKS.register('leap', Leap())",
        "TASKS.register('hover', Hover())",
    ]
    (folder / 'own_tasks.py').write_text('\n'.join(lines))
    return folder


def run_snca(plugin, *arguments, cwd):
    environment = {**os.environ, 'PYTHONPATH': f'{ROOT}{os.pathsep}{plugin}'}
    environment['SNCA_PLUGINS'] = 'own_tasks'
    return subprocess.run(
        [sys.executable, '-m', 'snca_ros', *map(str, arguments)], cwd=cwd, env=environment,
        capture_output=True, text=True, timeout=LIMIT, check=False,
    )


@pytest.mark.parametrize(('engine', 'task'), [('pymunk', 'hover'), ('batched', 'leap')])
def test_two_workers_know_it_from_a_plugin_and_a_stopped_run_goes_on(
    plugin, tmp_path, engine, task
):
    config = replace(CONFIG, engine=engine, task=task)
    evolved(tmp_path / 'one', config)
    whole = run_snca(
        plugin, 'evolve', *OPTIONS, '--engine', engine, '--task', task, '--workers', 2, '--run',
        'two', cwd=tmp_path,
    )
    assert whole.returncode == 0, whole.stderr
    assert_same_run(tmp_path / 'one', tmp_path / 'two')
    fitness = load_controller(tmp_path / 'two' / 'best.npz').fitness
    best = {'hover': f'airborne {fitness:.4f} in', 'leap': f'rise {fitness:.4f} m in'}[task]
    assert f'best.npz: {best} {engine}, ' in whole.stdout
    assert 'm/s' not in whole.stdout + whole.stderr
    assert f'task {task}' in whole.stderr

    class Stopped(Exception):
        pass

    def stop(progress):
        if len(progress.history) == 2:
            raise Stopped

    folder = RunFolder.create(tmp_path / 'cut', config)
    with pytest.raises(Stopped):
        evolve(folder, IN_PROCESS, stop)
    folder.close()
    shutil.copytree(tmp_path / 'cut', tmp_path / 'here')
    rest = run_snca(plugin, 'evolve', '--resume', 'cut', '--workers', 2, cwd=tmp_path)
    assert rest.returncode == 0, rest.stderr
    folder = RunFolder.resume(tmp_path / 'here')
    evolve(folder, IN_PROCESS)
    folder.close()
    assert_same_run(tmp_path / 'one', tmp_path / 'cut')
    assert_same_run(tmp_path / 'one', tmp_path / 'here')


def test_a_worker_that_does_not_know_it_says_so():
    with (
        local_workers(1) as workers,
        pytest.raises(InvalidInput, match=r"task: got 'leap', .* walk, jump, climb, economy$"),
    ):
        list(evaluate(workers, replace(CONFIG, task='leap'), np.zeros((1, CONFIG.n_parameters))))


def test_names_of_runs_and_what_files_without_a_task_are(tmp_path):
    leap = replace(CONFIG, task='leap')
    assert '-flat-leap-' in leap.name
    assert leap.name.replace('-leap', '') == CONFIG.name == replace(CONFIG, task='walk').name
    values = yaml.safe_load(leap.to_yaml())
    assert values.pop('task') == 'leap'
    assert RunConfig.from_dict(values) == CONFIG


def test_unknown_tasks_are_refused_with_the_known_ones(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    known = ', '.join(TASKS)
    expected = rf"task: got 'laep', expected one of {known} \(did you mean 'leap'\?\)"
    with pytest.raises(InvalidInput, match=expected):
        snca.evolve('11-10', task='laep')
    with pytest.raises(InvalidInput, match=expected):
        check_task('laep')
    assert cli.main(['evolve', *OPTIONS, '--task', 'laep']) == 2
    assert f"expected one of {known} (did you mean 'leap'?)" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
    config = replace(CONFIG, task='leap')
    RunFolder.create(tmp_path / 'run', config).close()
    save_controller(tmp_path / 'leap.npz', trained_by(config))
    del TASKS['leap']
    for path, load in (
        (tmp_path / 'leap.npz', load_controller), (tmp_path / 'run', RunFolder.resume)
    ):
        with pytest.raises(InvalidInput, match='walk, jump, climb, economy, hover') as caught:
            load(path)
        assert str(caught.value).startswith(f'{path}')
        assert "task: got 'leap'" in str(caught.value)
    TASKS.register('leap', Leap())


# --- what is said and drawn -------------------------------------------------------------------


def trained_by(config):
    morphology = config.simulation().morphology
    return TrainedController(
        config.architecture, morphology, parameters_of(morphology)[0], fitness=0.5,
        task=config.task,
    )


def test_python_names_quantity_and_unit(tmp_path):
    run = snca.evolve(
        '11-10', 'U-D', 'mlp', task='leap', episodes=4, population=4, duration=1.0,
        transient=0.2, run=tmp_path / 'run',
    )
    best = run.best.trained.fitness
    assert repr(run).endswith(f'4 of 4 episodes, best rise {best:.3f} m)')
    assert repr(run.best).endswith(f'evolved on flat to rise {best:.3f} m)')
    assert repr(run.best.trained).endswith(f'evolved on flat to rise {best:.3f} m)')
    assert f'best {best:.3f} m' in '\n'.join(describe_history(tmp_path / 'run'))
    scores = snca.assess(run.best, ['flat', 'uphill-10'], duration=5.1)
    simulation = run.best.trained.simulation()
    centers, _ = loop(simulation, run.best.trained.controller(), 306)
    assert scores.sel(robot=run.best.name, faults='', terrain='flat', start=0) == (
        TASKS['leap'].score(Episode(centers, False), 5.0)
    )
    assert repr(scores).startswith('Scores(robot 1, faults 1, terrain 2, start 1: rise ')
    assert repr(scores).endswith(' m)')
    with pytest.raises(InvalidInput, match=r"quantity: got 'rise', expected v_x; `values`"):
        _ = scores.v_x
    with pytest.raises(InvalidInput, match=r"controllers: got \['leap', 'walk'\], expected"):
        snca.assess([run.best, 'biped-U-D-mlp'])


def describe_history(path):
    from snca_ros.evolution.history import describe

    return describe(read_history(path))


def test_a_history_knows_its_unit_from_the_configuration_beside_it(tmp_path):
    evolved(tmp_path / 'run', replace(CONFIG, task='leap', episodes=4))
    run = read_history(tmp_path / 'run')
    assert (run.label, read_history(tmp_path / 'run' / 'history.csv').label) == ('rise [m]',) * 2
    alone = shutil.copy(tmp_path / 'run' / 'history.csv', tmp_path / 'alone.csv')
    assert read_history(tmp_path / 'alone.csv').label == 'fitness'
    assert describe_history(tmp_path / 'alone.csv')[0] == (
        f'{alone}: 4 episodes, best {run.rows[-1, -1]:.3f}'
    )


@pytest.mark.parametrize('faults', [(), ('--faults', 'loss=0..0.5..0.5', '--starts', '1')])
def test_assess_names_the_column_after_the_quantity(plugin, tmp_path, faults):
    trained = trained_by(replace(CONFIG, task='leap'))
    save_controller(tmp_path / 'leap.npz', trained)
    run = run_snca(
        plugin, 'assess', 'leap.npz', '--terrains', 'flat', '--duration', 5.1, *faults,
        '--workers', 2, '--csv', 'table.csv', '--figure', 'figure.svg', cwd=tmp_path,
    )
    assert run.returncode == 0, run.stderr
    assert 'v_x' not in run.stdout
    assert faults or 'rise [m] of episodes of 5.1 s' in run.stdout
    with (tmp_path / 'table.csv').open() as file:
        row = next(csv.DictReader(file))
    assert list(row)[-1] == 'rise'
    assert float(row['rise']) == score(Trial(trained, 'flat', duration=5.1)).score


def test_assess_refuses_controllers_of_several_tasks(tmp_path, capsys):
    trained = trained_by(replace(CONFIG, task='leap'))
    save_controller(tmp_path / 'leap.npz', trained)
    save_controller(tmp_path / 'walk.npz', replace(trained, task='walk'))
    code = cli.main(['assess', *(str(tmp_path / f'{name}.npz') for name in ('leap', 'walk'))])
    assert code == 2
    assert "controllers: got ['leap', 'walk'], expected" in capsys.readouterr().err


def test_figures_are_labelled_with_quantity_and_unit():
    sweep = parse_sweep('loss=0..0.5..0.5')
    figures = [
        draw_scores(['one'], ['flat'], np.ones((1, 1, 2)), TASKS['leap']),
        draw_sweeps(['one'], [sweep], [np.ones((1, 2, 3))], TASKS['leap']),
    ]
    labels = [figures[0].axes[0].get_xlabel(), figures[1].axes[0].get_ylabel()]
    assert labels == ['rise [m]', 'rise [m]']
    assert figures[0].axes[0].lines[-1].get_label() == 'one: mean 1.000 m'


def test_campaigns_refuse_it(tmp_path):
    path = tmp_path / 'campaign.yaml'
    good = {'shape': 'worm', 'architecture': 'U-D', 'neuron_model': 'mlp'}
    path.write_text(yaml.safe_dump({**good, 'task': 'walk'}))
    assert [config.task for config in read_campaign(path)] == ['walk']
    expected = "task: got 'leap', expected walk, since the results of a campaign are speeds"
    path.write_text(yaml.safe_dump({**good, 'task': ['walk', 'leap']}))
    with pytest.raises(InvalidInput, match=expected):
        read_campaign(path)
    with pytest.raises(InvalidInput, match=expected):
        perform(replace(CONFIG, task='leap'), tmp_path / 'run')
    assert not (tmp_path / 'run').exists()


def test_completion_and_help_offer_it(capsys):
    assert cli.main(['completion', 'bash']) == 0
    line = next(
        line for line in capsys.readouterr().out.splitlines()
        if '_evolve' in line and '__task_choices' in line
    )
    assert f'=({" ".join(TASKS)})' in line
    with pytest.raises(SystemExit):
        cli.main(['evolve', '--help'])
    assert f'{", ".join(TASKS)} (default walk)' in ' '.join(capsys.readouterr().out.split())
