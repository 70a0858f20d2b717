"""Evolution in the batched engine: the same run whatever the groups, and judged by pymunk."""

from dataclasses import replace

import numpy as np
import pytest

from sim_node.errors import InvalidInput
from sim_node.simulation import Simulation
from sim_node.solver import Solver
from snca_ros.cell.nca import Architecture
from snca_ros.controller import Controller
from snca_ros.controller_file import load_controller
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evaluator import Evaluator, evaluate, group_width
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.locomotion import run_episode
from snca_ros.evolution.workers import IN_PROCESS, local_workers

CONFIG = RunConfig(
    'worm-3x1', Architecture.named('U-D', 'mlp'), engine='batched',
    evaluations=20, population=8, duration=1.0, transient=0.2,
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
    assert other.reassessed.tolist() == progress.reassessed.tolist()
    assert (tmp_path / 'two' / 'history.csv').read_text() == (path / 'history.csv').read_text()


def test_scores_are_those_of_each_alone(whole):
    _, progress = whole
    evaluator = Evaluator(CONFIG)
    for theta, fitness in zip(
        progress.strategy['individuals'][:3], progress.strategy['fitness'], strict=False
    ):
        assert evaluator(theta[np.newaxis]) == [fitness]


def test_best_quarter_is_scored_again_in_pymunk(whole):
    path, progress = whole
    assert progress.reassessed.shape == (2,)
    in_pymunk = Evaluator(replace(CONFIG, engine='pymunk'))
    best_two = progress.strategy['individuals'][:2]
    assert in_pymunk(best_two) == progress.reassessed.tolist()
    trained = load_controller(path / 'best.npz')
    i = int(np.argmax(progress.reassessed))
    assert trained.theta.tolist() == best_two[i].tolist()
    assert trained.chosen_by == 'pymunk'
    assert trained.fitness == trained.v_x['pymunk'] == progress.reassessed[i]
    assert trained.v_x['batched'] == progress.strategy['fitness'][i]


def test_a_run_stopped_before_the_end_goes_on_to_the_same_end(whole, tmp_path):
    path, _ = whole
    folder = RunFolder.create(tmp_path / 'run', CONFIG)

    def stop(progress):
        if progress.evaluations > 8:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        evolve(folder, IN_PROCESS, stop)
    folder.close()
    unfinished = load_controller(tmp_path / 'run' / 'best.npz')
    assert (unfinished.chosen_by, list(unfinished.v_x)) == ('batched', ['batched'])
    folder = RunFolder.resume(tmp_path / 'run')
    evolve(folder, IN_PROCESS)
    folder.close()
    for name in ('history.csv', 'config.yaml'):
        assert (tmp_path / 'run' / name).read_text() == (path / name).read_text()
    ours, theirs = (load_controller(p / 'best.npz') for p in (tmp_path / 'run', path))
    assert ours.theta.tolist() == theirs.theta.tolist()
    assert ours.v_x == theirs.v_x


def test_a_run_in_pymunk_is_not_judged_twice(tmp_path):
    progress = run(tmp_path / 'run', 1, replace(CONFIG, engine='pymunk', evaluations=8))
    assert progress.reassessed.shape == (0,)
    trained = load_controller(tmp_path / 'run' / 'best.npz')
    assert trained.v_x == {'pymunk': trained.fitness}


@pytest.mark.parametrize('engine', ['batched', 'pymunk'])
def test_pushed_starts_are_those_of_the_simulation(engine):
    config = replace(CONFIG, engine=engine)
    thetas = np.random.default_rng(0).uniform(-1.0, 1.0, (3, config.n_parameters))
    pushes = (0, 3, 101, 0)
    found = [list(evaluate(IN_PROCESS, config, thetas, push)) for push in pushes]
    for push, of_push in zip(pushes, found, strict=True):
        simulation = Simulation('worm-3x1', engine=engine, push=push)
        controllers = [Controller(config.architecture, simulation.morphology, t) for t in thetas]
        episodes = [run_episode(simulation, c, config.duration) for c in controllers]
        assert of_push == [episode.velocity(config.transient) for episode in episodes]
    assert found[0] == found[-1] != found[1] != found[2]


@pytest.mark.parametrize(('n', 'width'), [(1, 4), (4, 4), (5, 8), (16, 16), (18, 16)])
def test_group_width(n, width):
    assert group_width(n) == width


def test_unknown_engine_and_what_the_batched_one_cannot():
    with pytest.raises(InvalidInput, match='engine'):
        replace(CONFIG, engine='batch')
    with pytest.raises(InvalidInput, match='pymunk'):
        replace(CONFIG, solver=Solver(self_collision=True))
