"""Runs on sets of episodes: their scores, budgets, choice of the best, and resumption."""

import contextlib
import shutil
from dataclasses import replace

import numpy as np
import pytest
from support.evolve import arrays_of, assert_same_run, history_of, stopped_after

from sim_node.errors import InvalidInput
from sim_node.simulation import Simulation
from sim_node.walls import Walls
from snca_ros.controller import Controller
from snca_ros.controller_file import load_controller
from snca_ros.evolution import evaluator
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import run_episode
from snca_ros.evolution.episode_set import N_FURTHER
from snca_ros.evolution.evaluator import evaluate_set
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.history import read_history
from snca_ros.evolution.tasks import Scored
from snca_ros.evolution.workers import IN_PROCESS, local_workers
from snca_ros.faults import Faults

SMALL = {
    'architecture': 'U-D', 'neuron_model': 'mlp', 'population': 8, 'duration': 1.0,
    'transient': 0.4, 'seed': 5,
}
FIXED = RunConfig.named(
    '11-10,111', terrain='flat,uphill-10', faults='none;loss=0.4,delay=1', episodes=100, **SMALL
)
DRAWN = RunConfig.named(
    '11-10,111', faults='none;loss=0..0.5,delay=0..2;sensor_noise=0..0.1', draw=3,
    score='quantile-0.5', episodes=170, **SMALL,
)


def evolved(path, config, report=lambda progress: None):
    with contextlib.closing(RunFolder.create_or_resume(path, config)) as folder:
        return evolve(folder, IN_PROCESS, report)


@pytest.fixture(scope='module')
def drawn(tmp_path_factory):
    """Return the folder of a run with drawn sets that nobody stopped, and its last progress."""
    path = tmp_path_factory.mktemp('drawn') / 'run'
    return path, evolved(path, DRAWN)


def alone(config, theta, conditions, engine='pymunk'):
    """Return the score of one episode, by nothing of the evaluator."""
    simulation = Simulation(
        conditions.shape, conditions.terrain, engine=engine, push=conditions.push,
        material=config.material, solver=config.solver, **conditions.faults.of_body,
    )
    controller = Controller(
        config.architecture, simulation.morphology, theta, conditions.faults
    )
    return run_episode(simulation, controller, config.duration).velocity(config.transient)


def test_a_candidate_is_scored_on_its_whole_set(tmp_path):
    progress = evolved(tmp_path / 'run', FIXED)
    assert FIXED.episode_set.n_episodes == 8
    rows = history_of(tmp_path / 'run')
    # 8 candidates, then 4, for which there are episodes; 4 of the 100 are left.
    assert [int(row['episodes']) for row in rows] == [64, 96]
    trained = load_controller(tmp_path / 'run' / 'best.npz')
    scores = [alone(FIXED, trained.parameters, one) for one in FIXED.episode_set.conditions(5, 0)]
    assert len(set(scores)) == 8
    assert trained.fitness == pytest.approx(np.mean(scores), rel=1e-12)
    assert progress.population[0].shape[0] == 8
    assert (trained.morphology.name, trained.terrain) == ('11-10', 'flat')
    assert trained.episode_set == FIXED.episode_set
    assert trained.evaluations == 96
    assert trained.achieved == f'mean v_x {trained.fitness:.3f} m/s over 8 episodes'
    history = read_history(tmp_path / 'run')
    assert (history.episodes, history.total, history.finished) == (96, 100, True)


def test_the_score_does_not_depend_on_workers_or_groups():
    thetas = np.random.default_rng(1).uniform(-1.0, 1.0, (5, FIXED.n_parameters))
    conditions = FIXED.episode_set.conditions(5, 0)[1:3]
    found = evaluate_set(IN_PROCESS, FIXED, thetas, conditions)
    expected = [np.mean([alone(FIXED, theta, one) for one in conditions]) for theta in thetas]
    np.testing.assert_allclose([one.score for one in found], expected, rtol=1e-12)
    for theta, one in zip(thetas, found, strict=True):
        assert evaluate_set(IN_PROCESS, FIXED, theta[np.newaxis], conditions) == [one]
    with local_workers(2) as workers:
        assert evaluate_set(workers, FIXED, thetas, conditions) == found


def test_lanes_give_the_bits_of_one_robot_at_a_time():
    config = RunConfig.named('11-10,111', starts=2, engine='batched', **SMALL)
    thetas = np.random.default_rng(1).uniform(-1.0, 1.0, (6, config.n_parameters))
    conditions = config.episode_set.conditions(5, 0)
    found = evaluate_set(IN_PROCESS, config, thetas, conditions)
    for theta, one in zip(thetas, found, strict=True):
        scores = [alone(config, theta, of_one, 'batched') for of_one in conditions]
        assert one.score == config.episode_set.combined(scores)


def test_each_generation_has_a_set_of_its_own_and_scores_the_best_again(drawn):
    path, progress = drawn
    rows = history_of(path)
    # 8 candidates in 3 episodes, then 7 and the best again; 2 parents in 32 at the end.
    assert [int(row['episodes']) for row in rows] == [24, 48, 72, 96]
    assert DRAWN.reserved == len(progress.further) * N_FURTHER == 64
    assert progress.episodes == 96 + 64
    assert not DRAWN.room(96)
    strategy = DRAWN.new_strategy()
    for generation, row in enumerate(rows):
        conditions = DRAWN.episode_set.conditions(5, generation)
        kept, candidates = strategy.individuals[:1], strategy.ask()
        of_all = [
            DRAWN.episode_set.combined([alone(DRAWN, theta, one) for one in conditions])
            for theta in [*kept, *candidates]
        ]
        if generation:
            strategy.fitness = np.array([of_all[0], *strategy.fitness[1:]])
        strategy.tell(candidates, np.array(of_all[len(kept):]))
        assert float(row['best']) == max(of_all[len(kept):])
        assert float(row['best_so_far']) == max(of_all) == strategy.fitness[0]
    np.testing.assert_array_equal(strategy.individuals, progress.strategy['individuals'])
    np.testing.assert_array_equal(strategy.fitness, progress.strategy['fitness'])


def test_the_best_is_chosen_among_the_parents_by_further_episodes(drawn):
    path, progress = drawn
    conditions = DRAWN.episode_set.further_conditions(5)
    parents = progress.strategy['individuals'][: DRAWN.n_elite]
    scores = [
        DRAWN.episode_set.combined([alone(DRAWN, theta, one) for one in conditions])
        for theta in parents
    ]
    assert progress.further.tolist() == scores
    trained = load_controller(path / 'best.npz')
    best = int(np.argmax(scores))
    np.testing.assert_array_equal(trained.parameters, parents[best])
    assert (trained.fitness, trained.n_episodes, trained.evaluations) == (scores[best], 32, 160)
    assert trained.achieved == f'quantile-0.5 v_x {scores[best]:.3f} m/s over 32 episodes'
    assert trained.scores['pymunk'] == trained.fitness
    assert read_history(path).finished


@pytest.mark.parametrize('strategy', ['es', 'cma'])
def test_a_stopped_run_goes_on_as_if_never_stopped(tmp_path, drawn, strategy):
    config, whole = replace(DRAWN, strategy=strategy), drawn[0]
    if strategy == 'cma':
        pytest.importorskip('cma')
        whole = tmp_path / 'whole'
        assert evolved(whole, config).episodes <= config.episodes
    for episodes in (1, 25, 60, 90):
        with contextlib.suppress(KeyboardInterrupt):
            evolved(tmp_path / 'run', config, stopped_after(episodes))
        assert not read_history(tmp_path / 'run').finished
        held = load_controller(tmp_path / 'run' / 'best.npz')
        assert held.n_episodes == 3
    evolved(tmp_path / 'run', config)
    assert_same_run(whole, tmp_path / 'run')
    before = (tmp_path / 'run' / 'checkpoint.npz').read_bytes()
    evolved(tmp_path / 'run', config)
    assert (tmp_path / 'run' / 'checkpoint.npz').read_bytes() == before


def test_a_kill_before_the_choice_of_the_best_changes_nothing(tmp_path, drawn, monkeypatch):
    def killed(*_):
        raise KeyboardInterrupt

    with monkeypatch.context() as patch, contextlib.suppress(KeyboardInterrupt):
        patch.setattr('snca_ros.evolution.evolve._finish', killed)
        evolved(tmp_path / 'run', DRAWN)
    assert 'further' not in arrays_of(tmp_path / 'run' / 'checkpoint.npz')
    assert not read_history(tmp_path / 'run').finished
    evolved(tmp_path / 'run', DRAWN)
    assert_same_run(drawn[0], tmp_path / 'run')


@pytest.mark.parametrize('episodes', [67, 88])
def test_a_budget_within_the_first_generation(tmp_path, episodes):
    config = replace(DRAWN, episodes=episodes)
    progress = evolved(tmp_path / 'run', config)
    n = (episodes - 64) // 3
    assert [row['episodes'] for row in history_of(tmp_path / 'run')] == [str(3 * n)]
    assert len(progress.further) == min(n, 2)
    assert progress.episodes <= episodes


@pytest.mark.parametrize('damage', [
    lambda further: further[:, np.newaxis], lambda further: np.tile(further, 3),
    lambda further: further.astype(str),
])
def test_damaged_further_scores_are_refused(tmp_path, drawn, damage):
    shutil.copytree(drawn[0], tmp_path / 'run')
    path = tmp_path / 'run' / 'checkpoint.npz'
    arrays = arrays_of(path)
    np.savez(path, **{**arrays, 'further': damage(arrays['further'])})
    with pytest.raises(InvalidInput, match=r'checkpoint\.npz: further'):
        evolved(tmp_path / 'run', DRAWN)


def test_a_robot_that_meets_the_wall_in_an_episode_is_told(monkeypatch):
    steps = iter([None, 180, 120, None, None, None])

    def scored(config, candidates, conditions):
        return [Scored(1.0, Walls(None, next(steps))) for _ in candidates]

    monkeypatch.setattr(evaluator, 'score', scored)
    thetas = np.zeros((1, FIXED.n_parameters))
    conditions = FIXED.episode_set.conditions(5, 0)[:3]
    assert [evaluate_set(IN_PROCESS, FIXED, thetas, conditions)[0].wall_time for _ in '12'] == [
        2.0, None
    ]


def test_faults_of_a_fixed_set_act_in_the_pymunk_engine():
    config = RunConfig.named('11-10', faults='none;loss=1;broken_actuators=zero:1', **SMALL)
    thetas = np.random.default_rng(2).uniform(-1.0, 1.0, (1, config.n_parameters))
    conditions = config.episode_set.conditions(0, 0)
    assert conditions[1].faults == Faults(loss=1.0)
    none, deaf, limp = (
        evaluate_set(IN_PROCESS, config, thetas, [one])[0].score for one in conditions
    )
    assert len({none, deaf, limp}) == 3
    assert abs(limp) < abs(none)
