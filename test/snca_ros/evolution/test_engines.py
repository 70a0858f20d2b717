"""Evolution in the batched engine: the same run whatever the groups; how a run ends."""

import shutil
from dataclasses import replace

import numpy as np
import pytest

from sim_node.batched.engine import BatchedEngine
from sim_node.engine import ENGINES
from sim_node.errors import InvalidInput
from sim_node.model.solver import Solver
from sim_node.simulation import Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller
from snca_ros.controller_file import load_controller, save_controller
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import run_episode
from snca_ros.evolution.evaluator import Evaluator, evaluate, group_width
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.workers import IN_PROCESS, local_workers
from snca_ros.faults import parse_faults

CONFIG = RunConfig(
    'worm-3x1', Architecture.named('U-D', 'mlp'), engine='batched',
    episodes=20, population=8, duration=1.0, transient=0.2,
)


def run(path, n_workers, config=CONFIG):
    folder = RunFolder.create(path, config)
    with local_workers(n_workers) as workers:
        progress = evolve(folder, workers)
    folder.close()
    return progress


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """A run with one worker."""
    path = tmp_path_factory.mktemp('batched') / 'run'
    return path, run(path, 1)


def test_groups_of_other_sizes_give_the_same_run(whole, tmp_path):
    path, progress = whole
    other = run(tmp_path / 'two', 2)  # groups of 4 robots rather than 8
    assert other.history == progress.history
    assert other.score_other == progress.score_other
    assert (tmp_path / 'two' / 'history.csv').read_text() == (path / 'history.csv').read_text()


def test_scores_are_those_of_each_alone(whole):
    _, progress = whole
    evaluator = Evaluator(CONFIG)
    for theta, fitness in zip(
        progress.strategy['individuals'][:3], progress.strategy['fitness'], strict=False
    ):
        assert evaluator(theta[np.newaxis])[0].score == fitness


@pytest.mark.parametrize('engine', ['batched', 'pymunk'])
def test_best_is_that_of_the_runs_engine_and_walks_once_in_the_other(whole, tmp_path, engine):
    path, progress = whole
    if engine == 'pymunk':
        path = tmp_path / 'run'
        progress = run(path, 1, replace(CONFIG, engine=engine, episodes=9))
    trained = load_controller(path / 'best.npz')
    best = progress.strategy['individuals'][:1]
    assert trained.parameters.tolist() == best[0].tolist()
    assert trained.chosen_by == engine
    assert trained.fitness == progress.strategy['fitness'].max() == progress.history[-1][-1]
    assert trained.scores == {
        e: Evaluator(replace(CONFIG, engine=e))(best)[0].score for e in ENGINES
    }


def test_last_whole_population_outlives_a_generation_that_the_budget_cuts(whole):
    path, progress = whole
    assert [row[1] for row in progress.history] == [8, 15, 20]
    individuals, fitness = progress.population
    assert (individuals.shape, fitness.shape) == ((8, CONFIG.n_parameters), (8,))
    assert (np.diff(fitness) <= 0.0).all()
    assert [one.score for one in Evaluator(CONFIG)(individuals)] == fitness.tolist()
    strategy = CONFIG.new_strategy()
    for _ in range(2):
        candidates = strategy.ask()
        scored = Evaluator(CONFIG)(candidates)
        strategy.tell(candidates, np.array([one.score for one in scored]))
    assert individuals.tolist() == strategy.individuals.tolist()
    assert len(progress.strategy['individuals']) == 1 + 5
    assert_same(RunFolder.resume(path).load().population, progress.population)


@pytest.mark.parametrize(('episodes', 'n'), [(5, 5), (8, 8), (15, 8)])
def test_a_budget_that_cuts_no_later_generation_has_its_population_in_the_strategy(
    tmp_path, episodes, n
):
    progress = run(tmp_path / 'run', 1, replace(CONFIG, episodes=episodes))
    assert progress.whole is None
    assert_same(progress.population, (
        progress.strategy['individuals'], progress.strategy['fitness']
    ))
    assert len(progress.population[1]) == n


def assert_same(found, expected):
    assert [array.tolist() for array in found] == [array.tolist() for array in expected]


def finished_by_old_rules(path, progress, **entries):
    """Make a run folder as an earlier version left it, with its best.npz; return its bytes."""
    shutil.copytree(path, path.parent / 'old')
    old = path.parent / 'old'
    arrays = {**progress.strategy, 'history': np.array(progress.history), **entries}
    np.savez(old / 'checkpoint.npz', **arrays)
    trained = load_controller(path / 'best.npz')
    i = int(np.argmax(entries.get('reassessed', [0.0])))
    fitness = {'batched': float(progress.strategy['fitness'][i])}
    if 'reassessed' in entries:
        fitness['pymunk'] = float(entries['reassessed'][i])
    save_controller(old / 'best.npz', replace(
        trained, parameters=progress.strategy['individuals'][i], scores=fitness,
        fitness=list(fitness.values())[-1], chosen_by=list(fitness)[-1],
        versions={'snca_ros': 'an earlier one'},
    ))
    return old, {p.name: p.read_bytes() for p in old.iterdir()}


@pytest.mark.parametrize('entries', [{'reassessed': np.array([0.25, 0.5])}, {}])
def test_a_run_that_an_earlier_version_finished_stays_as_it_is(whole, tmp_path, entries):
    shutil.copytree(whole[0], tmp_path / 'run')
    old, before = finished_by_old_rules(tmp_path / 'run', whole[1], **entries)
    folder = RunFolder.resume(old)
    progress = evolve(folder, IN_PROCESS)
    folder.close()
    assert progress.by_old_rules
    assert {p.name: p.read_bytes() for p in old.iterdir()} == before
    assert load_controller(old / 'best.npz').chosen_by == ('pymunk' if entries else 'batched')
    # What a kill left half written is mended, by the rules of that run.
    (old / 'best.npz').write_bytes(before['best.npz'][:100])
    RunFolder.resume(old).load()
    mended = load_controller(old / 'best.npz')
    assert mended.parameters.tolist() == progress.strategy['individuals'][len(entries)].tolist()
    assert mended.fitness == (0.5 if entries else progress.strategy['fitness'][0])


def test_a_run_that_an_earlier_version_began_ends_by_todays_rules(whole, tmp_path):
    path, _ = whole
    folder = RunFolder.create(tmp_path / 'run', CONFIG)
    with pytest.raises(KeyboardInterrupt):
        evolve(folder, IN_PROCESS, stop)
    folder.close()
    checkpoint = tmp_path / 'run' / 'checkpoint.npz'
    with np.load(checkpoint) as data:
        kept = 'individuals', 'fitness', 'generation', 'history'
        np.savez(checkpoint, **{name: data[name] for name in kept}, reassessed=np.empty(0))
    folder = RunFolder.resume(tmp_path / 'run')
    evolve(folder, IN_PROCESS)
    folder.close()
    for name in ('checkpoint.npz', 'best.npz', 'history.csv'):
        assert (tmp_path / 'run' / name).read_bytes() == (path / name).read_bytes()


def stop(progress):
    if progress.episodes > 8:
        raise KeyboardInterrupt


def test_a_run_stopped_before_the_end_goes_on_to_the_same_end(whole, tmp_path):
    path, _ = whole
    folder = RunFolder.create(tmp_path / 'run', CONFIG)
    with pytest.raises(KeyboardInterrupt):
        evolve(folder, IN_PROCESS, stop)
    folder.close()
    unfinished = load_controller(tmp_path / 'run' / 'best.npz')
    assert (unfinished.chosen_by, list(unfinished.scores)) == ('batched', ['batched'])
    folder = RunFolder.resume(tmp_path / 'run')
    evolve(folder, IN_PROCESS)
    folder.close()
    for name in ('history.csv', 'config.yaml', 'checkpoint.npz', 'best.npz'):
        assert (tmp_path / 'run' / name).read_bytes() == (path / name).read_bytes()


def test_a_run_killed_before_the_other_engine_goes_on_to_the_same_end(whole, tmp_path):
    path, progress = whole
    shutil.copytree(path, tmp_path / 'run')
    folder = RunFolder.resume(tmp_path / 'run')
    folder.save(replace(progress, score_other=None))
    folder.close()
    assert list(load_controller(tmp_path / 'run' / 'best.npz').scores) == ['batched']
    folder = RunFolder.resume(tmp_path / 'run')
    assert evolve(folder, IN_PROCESS).score_other == progress.score_other
    folder.close()
    for name in ('checkpoint.npz', 'best.npz'):
        assert (tmp_path / 'run' / name).read_bytes() == (path / name).read_bytes()


def test_a_run_that_the_other_engine_cannot_do_has_one_speed(tmp_path):
    config = replace(
        CONFIG, engine='pymunk', episodes=8, solver=Solver(self_collision=True)
    )
    progress = run(tmp_path / 'run', 1, config)
    trained = load_controller(tmp_path / 'run' / 'best.npz')
    assert trained.scores == {'pymunk': trained.fitness}
    assert np.isnan(progress.score_other)
    folder = RunFolder.resume(tmp_path / 'run')
    assert np.isnan(evolve(folder, IN_PROCESS).score_other)
    folder.close()


@pytest.mark.parametrize('engine', ['batched', 'pymunk'])
def test_pushed_starts_are_those_of_the_simulation(engine):
    config = replace(CONFIG, engine=engine)
    thetas = np.random.default_rng(0).uniform(-1.0, 1.0, (3, config.n_parameters))
    pushes = (0, 3, 101, 0)
    found = [
        [one.score for one in evaluate(IN_PROCESS, config, thetas, config.conditions(push))]
        for push in pushes
    ]
    for push, of_push in zip(pushes, found, strict=True):
        simulation = Simulation('worm-3x1', engine=engine, push=push)
        controllers = [Controller(config.architecture, simulation.morphology, t) for t in thetas]
        episodes = [run_episode(simulation, c, config.duration) for c in controllers]
        assert of_push == [episode.velocity(config.transient) for episode in episodes]
    assert found[0] == found[-1] != found[1] != found[2]


@pytest.mark.parametrize('engine', ['batched', 'pymunk'])
def test_faults_are_those_of_the_robot(engine):
    config = replace(CONFIG, engine=engine)
    faults = parse_faults('loss=0.5,sensor_noise=0.1,seed=2')
    thetas = np.random.default_rng(0).uniform(-1.0, 1.0, (3, config.n_parameters))
    conditions = replace(config.conditions(3), faults=faults)
    found = [one.score for one in evaluate(IN_PROCESS, config, thetas, conditions)]
    simulation = Simulation('worm-3x1', engine=engine, push=3, **faults.of_body)
    for theta, v_x in zip(thetas, found, strict=True):
        controller = Controller(config.architecture, simulation.morphology, theta, faults)
        episode = run_episode(simulation, controller, config.duration)
        assert v_x == episode.velocity(config.transient)
    sound = evaluate(IN_PROCESS, config, thetas, config.conditions(3))
    assert all(one.score != v_x for one, v_x in zip(sound, found, strict=True))


@pytest.mark.parametrize(('n', 'width'), [(1, 4), (4, 4), (5, 8), (16, 16), (18, 16)])
def test_group_width(n, width):
    assert group_width(BatchedEngine.lanes, n) == width
    assert group_width((1,), n) == 1


def test_unknown_engine_and_what_the_batched_one_cannot():
    with pytest.raises(InvalidInput, match='engine'):
        replace(CONFIG, engine='batch')
    with pytest.raises(InvalidInput, match='pymunk'):
        replace(CONFIG, solver=Solver(self_collision=True))
