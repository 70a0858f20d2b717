"""An engine that lives outside the tree plugs in by its name, and no file is touched for it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from sim_node.batched.engine import BatchedEngine
from sim_node.engine import ENGINES, Engine, check_engine
from sim_node.errors import InvalidInput
from sim_node.model.body import build_body
from sim_node.model.sensors import soft_normalise
from sim_node.model.solver import Solver
from sim_node.munk2d.engine import PymunkEngine
from sim_node.simulation import Diverged, Simulation
from snca_ros.assessment.trials import Trial, score
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller
from snca_ros.controller_file import load_controller
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import EPISODE_RUNNERS, run_episode, run_step_by_step
from snca_ros.evolution.evaluator import evaluate
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.workers import IN_PROCESS
from snca_ros.faults import parse_faults

LIMIT = 50.0  # m/s


class Sledge(Engine):
    """The robot slides as one piece, at as many m/s as its voxels' actuation adds up to."""

    def __init__(self, morphology, terrain, material, solver, push=0):
        self._n = morphology.n_voxels
        self._start = build_body(morphology, terrain, material).positions + 1e-6 * push

    def reset(self):
        n = self._n
        masses = np.zeros((4 * n, 5))
        masses[:, :2] = self._start
        self.world = SimpleNamespace(
            masses=masses, corners=masses[:, :2].reshape(n, 4, 2), area_ratios=np.ones(n),
            touching=np.ones(n), actuation=np.zeros(n),
        )

    def step(self, actuation, step):
        self.world.actuation[:] = np.clip(actuation, -1.0, 1.0)
        self.world.masses[:, 3] = self.world.actuation.sum()
        self.world.masses[:, 0] += self.world.masses[:, 3] / 60.0
        return abs(self.world.masses[0, 3]) < LIMIT


@pytest.fixture(autouse=True)
def sledge():
    ENGINES.register('sledge', Sledge)
    yield
    del ENGINES['sledge']


CONFIG = RunConfig(
    'biped', Architecture.named('U-nD', 'mlp'), episodes=14, population=6, duration=1.0,
    transient=0.2,
)


@pytest.fixture
def config():
    return replace(CONFIG, engine='sledge')


def controller(morphology, seed=0, faults=None):
    n = CONFIG.architecture.n_parameters(morphology.n_voxels)
    theta = np.random.default_rng(seed).uniform(-1.0, 1.0, n)
    return Controller(CONFIG.architecture, morphology, theta, faults)


def test_a_simulation_steps_it():
    simulation = Simulation('biped', engine='sledge')
    start = simulation.center
    for _ in range(60):
        readings = simulation.step(np.full(10, 0.25))
    np.testing.assert_allclose(simulation.center - start, (2.5, 0.0), atol=1e-12)
    assert simulation.velocity.tolist() == [2.5, 0.0]
    assert readings[0].tolist() == [0.5, 1.0, soft_normalise(2.5, -8.0, 8.0), 0.5]
    assert (simulation.engine, simulation.time) == ('sledge', 1.0)
    assert simulation.reset()[0, 2] == 0.5
    assert simulation.center.tolist() == start.tolist()


def test_it_diverges_where_it_says_so():
    simulation = Simulation('box-10x10', engine='sledge')
    with pytest.raises(Diverged, match=r'step 1$'):
        simulation.step(np.ones(100))


def test_faults_of_the_body_are_the_simulations():
    faults = parse_faults(
        'broken_actuators=frozen:0.5@0.1,broken_sensors=zero:0.3,sensor_noise=0.1,seed=3'
    )
    simulation = Simulation('biped', engine='sledge', **faults.of_body)
    reference = Simulation('biped', **faults.of_body)
    for k in range(20):
        values = np.full(10, 0.01 * k)
        readings, other = simulation.step(values), reference.step(values)
        broken = simulation.world.actuation != values
        assert broken.sum() == (5 if k > 5 else 0)
        np.testing.assert_array_equal(simulation.world.actuation, reference.world.actuation)
        np.testing.assert_array_equal((readings == 0.0).all(axis=1), (other == 0.0).all(axis=1))


def test_an_episode_is_the_loop():
    simulation = Simulation('biped', engine='sledge', push=2)
    own = controller(simulation.morphology)
    centers, readings = [simulation.center], simulation.reset()
    for _ in range(30):
        readings = simulation.step(own.step(readings))
        centers.append(simulation.center)
    episode = run_episode(simulation, own, 0.5)
    np.testing.assert_array_equal(episode.centers, centers)
    assert not episode.diverged
    assert episode.velocity() != 0.0


def test_runs_evolve_in_it_and_their_best_is_assessed_in_it(config, tmp_path):
    folder = RunFolder.create(tmp_path / 'run', config)
    progress = evolve(folder, IN_PROCESS)
    folder.close()
    best = progress.strategy['individuals'][:1]
    trained = load_controller(tmp_path / 'run' / 'best.npz')
    assert (trained.chosen_by, list(trained.scores)) == ('sledge', ['sledge', 'pymunk'])
    assert trained.fitness == next(evaluate(IN_PROCESS, config, best)).score
    assert 'sledge' in config.name
    trial = Trial(trained, 'flat', 'sledge', duration=1.0, transient=0.2)
    assert score(trial).score == trained.fitness
    pushed, = evaluate(IN_PROCESS, config, best, config.conditions(5))
    assert score(replace(trial, start=5)) == pushed


def test_a_group_of_candidates_scores_as_each_alone(config):
    thetas = np.random.default_rng(1).uniform(-1.0, 1.0, (5, config.n_parameters))
    together = list(evaluate(IN_PROCESS, config, thetas))
    assert together == [next(evaluate(IN_PROCESS, config, theta[None])) for theta in thetas]
    assert len(set(together)) == 5


def test_what_it_does_not_declare_is_refused(config):
    with pytest.raises(InvalidInput, match=r'false with the sledge engine; only the pymunk engine'):
        replace(config, solver=Solver(self_collision=True))
    assert Sledge.lanes == (1,)


def test_names_are_told():
    with pytest.raises(InvalidInput, match=r"pymunk, batched, sledge \(did you mean 'sledge'\?\)"):
        Simulation('biped', engine='slegde')
    with pytest.raises(InvalidInput, match='not taken'):
        ENGINES.register('batched', Sledge)
    ENGINES.register('sledge', Sledge)  # again is no other
    for name, engine in (('pymunk', PymunkEngine), ('batched', BatchedEngine), ('sledge', Sledge)):
        assert ENGINES[name] is check_engine(name, Solver()) is engine


def test_a_class_that_derives_from_an_engine_is_not_run_the_fast_way_of_that_engine():
    class Frozen(PymunkEngine):
        def step(self, actuation, step):
            return True

    ENGINES['frozen'] = Frozen
    try:
        simulation = Simulation('biped', engine='frozen')
    finally:
        del ENGINES['frozen']
    episode = run_episode(simulation, controller(simulation.morphology), 0.5)
    assert np.ptp(episode.centers, axis=0).tolist() == [0.0, 0.0]


@pytest.mark.parametrize('engine', EPISODE_RUNNERS)
def test_the_fast_way_of_an_engine_gives_the_bits_of_the_loop(engine):
    name = next(n for n in ENGINES if ENGINES[n] is engine)
    faults = parse_faults('loss=0.2,broken_actuators=frozen:0.5@0.5,sensor_noise=0.05,seed=2')
    simulation = Simulation('biped', engine=name, **faults.of_body)
    own = controller(simulation.morphology, faults=faults)
    fast = run_episode(simulation, own, 2.0)
    np.testing.assert_array_equal(run_step_by_step(simulation, own, 120).centers, fast.centers)
