"""An episode's v_x, and that the compiled episode is the loop that anybody would write."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_node.model.material import Material
from sim_node.model.solver import Solver
from sim_node.simulation import Diverged, Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller
from snca_ros.evolution.episode import (
    EPISODE,
    TRANSIENT,
    Episode,
    mean_velocity,
    run_episode,
)
from snca_ros.faults import Faults, parse_faults

quick = settings(max_examples=50)

DIVERGING = {
    'material': Material(frequency=30.0, damping_ratio=0.0), 'solver': Solver(physics='first'),
}
"""Springs too stiff for the physics step: within seconds nothing is finite."""


def make_controller(morphology, name, model, seed=0, scale=1.0, faults=None):
    architecture = Architecture.named(name, model)
    n = architecture.n_parameters(morphology.n_voxels)
    theta = scale * np.random.default_rng(seed).uniform(-1, 1, n)
    return Controller(architecture, morphology, theta, faults)


def loop(simulation, controller, n_steps):
    """Return centres, readings and actuations of the episode, step by step in Python."""
    controller.reset()
    readings = [simulation.reset()]
    centers, actuations = [simulation.center], []
    for _ in range(n_steps):
        actuations.append(controller.step(readings[-1]))
        readings.append(simulation.step(actuations[-1]))
        centers.append(simulation.center)
    return np.array(centers), np.array(readings), np.array(actuations)


# --- v_x --------------------------------------------------------------------------------------


def test_the_papers_episode():
    assert (EPISODE, TRANSIENT) == (30.0, 5.0)
    # 100 m in the first 5 s, which are discarded, then 1 m in 25 s.
    x = np.concatenate([np.linspace(0, 100, 301), np.linspace(100, 101, 1501)[1:]])
    assert len(x) == 1801
    assert mean_velocity(x) == pytest.approx(1 / 25, rel=1e-12)


@pytest.mark.parametrize(
    ('n_steps', 'transient', 'first'),
    [(60, 0.0, 0), (60, 0.5, 30), (60, 0.2, 12), (90, 0.99, 59), (61, 1.0, 60)],
)
def test_distance_over_time_after_the_transient(n_steps, transient, first):
    x = np.random.default_rng(n_steps).normal(size=n_steps + 1)
    expected = (x[n_steps] - x[first]) * 60 / (n_steps - first)
    assert mean_velocity(x, transient) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize('n_steps', [1, 59, 60])
def test_transient_as_long_as_the_episode_discards_nothing(n_steps):
    x = np.linspace(0.0, 2.0, n_steps + 1)
    assert mean_velocity(x, 1.0) == pytest.approx(2.0 * 60 / n_steps)


@pytest.mark.parametrize('x', [[], [7.0]])
def test_no_step_no_velocity(x):
    assert mean_velocity(np.array(x)) == 0.0


@quick
@given(
    speed=st.floats(-10, 10), start=st.floats(-100, 100), n_steps=st.integers(2, 400),
    transient=st.floats(0, 8),
)
def test_constant_speed_is_found_whatever_is_discarded(speed, start, n_steps, transient):
    x = start + speed * np.arange(n_steps + 1) / 60
    assert mean_velocity(x, transient) == pytest.approx(speed, abs=1e-9)


def test_velocity_of_an_episode_is_that_of_x_alone():
    y = np.random.default_rng(0).normal(size=601)
    episode = Episode(np.column_stack([np.arange(601) / 60 * 3.0, y]), diverged=False)
    assert episode.velocity() == pytest.approx(3.0)
    assert episode.velocity(transient=0.0) == pytest.approx(3.0)


@pytest.mark.parametrize('transient', [0.0, 5.0])
def test_velocity_of_a_diverged_episode(transient):
    centers = np.zeros((1801, 2))
    assert Episode(centers, diverged=True).velocity(transient) == -np.inf


# --- the episode ------------------------------------------------------------------------------


@pytest.mark.parametrize('sensor_noise', [0.0, 0.05])
@pytest.mark.parametrize(
    ('shape', 'name', 'model'),
    [
        ('biped', 'U-nD', 'snn-h'),
        ('biped', 'U-D', 'snn'),
        ('biped', 'nU-D', 'mlp'),
        ('worm', 'U-nD', 'mlp'),
        ('comb', 'nU-D', 'snn-h'),
    ],
)
def test_episode_is_the_loop_bit_for_bit(shape, name, model, sensor_noise):
    n_steps = 240
    simulation, fused = (
        Simulation(shape, 'hilly-0.5-10-0', sensor_noise=sensor_noise, seed=5) for _ in range(2)
    )
    controller = make_controller(simulation.morphology, name, model, scale=2.0)
    centers, readings, actuations = loop(simulation, controller, n_steps)
    assert np.ptp(actuations) > 0.5  # the robot does move
    outbox = controller.cells.outbox.copy()

    other = make_controller(fused.morphology, name, model, scale=2.0)
    for _ in range(2):  # the second one is not another
        episode = run_episode(fused, other, n_steps / 60)
        assert not episode.diverged
        np.testing.assert_array_equal(episode.centers, centers)
        np.testing.assert_array_equal(fused.readings, readings[-1])
        np.testing.assert_array_equal(fused.world.actuation, actuations[-1])
        np.testing.assert_array_equal(other.cells.outbox, outbox)
        assert fused.step_count == other.step_count == n_steps
        assert fused.time == n_steps / 60


@pytest.mark.parametrize('text', [
    'loss=0.3,delay=2,death=0.4@1-2,broken_sensors=frozen:0.3@1.5,'
    'broken_actuators=random:voxel_0_0@1-3,sensor_noise=0.05,seed=3',
    'broken_actuators=zero:0.5@2', 'loss=0.5',
])
def test_faulty_episode_is_the_loop_bit_for_bit(text):
    faults, none = parse_faults(text), Faults()
    simulation = Simulation('biped', 'hilly-0.5-10-0', **faults.of_body)
    controller = make_controller(simulation.morphology, 'U-nD', 'snn-h', scale=2.0, faults=faults)
    centers, readings, _ = loop(simulation, controller, 240)
    for _ in range(2):  # the second one is not another
        np.testing.assert_array_equal(run_episode(simulation, controller, 4.0).centers, centers)
        np.testing.assert_array_equal(simulation.readings, readings[-1])
    simulation = Simulation('biped', 'hilly-0.5-10-0', **none.of_body)
    sound = make_controller(simulation.morphology, 'U-nD', 'snn-h', scale=2.0, faults=none)
    assert not np.array_equal(run_episode(simulation, sound, 4.0).centers, centers)


@pytest.mark.parametrize('substeps', [1, 3])
def test_episode_may_follow_anything(substeps):
    simulation = Simulation('biped', solver=Solver(substeps=substeps), sensor_noise=0.1)
    controller = make_controller(simulation.morphology, 'U-nD', 'snn-h')
    first = run_episode(simulation, controller, 2.0)
    for _ in range(7):
        controller.step(simulation.step(np.ones(10)))
    again = run_episode(simulation, controller, 2.0)
    np.testing.assert_array_equal(again.centers, first.centers)
    np.testing.assert_array_equal(loop(simulation, controller, 120)[0], first.centers)


def test_noise_and_its_seed_matter():
    ends = set()
    for options in ({}, {'sensor_noise': 0.1, 'seed': 1}, {'sensor_noise': 0.1, 'seed': 2}):
        simulation = Simulation('biped', **options)
        controller = make_controller(simulation.morphology, 'U-D', 'mlp')
        ends.add(tuple(run_episode(simulation, controller, 2.0).centers[-1]))
    assert len(ends) == 3


def test_longer_episode_begins_as_the_shorter_one():
    simulation = Simulation('worm', sensor_noise=0.1)
    controller = make_controller(simulation.morphology, 'U-nD', 'snn')
    short = run_episode(simulation, controller, 1.0).centers
    long = run_episode(simulation, controller, 3.0).centers
    assert (len(short), len(long)) == (61, 181)
    np.testing.assert_array_equal(short, long[:61])


def test_resting_robot_stays_where_it_was_put():
    # Weights 0: an MLP sends a = 0; the robot falls and comes to rest.
    simulation = Simulation('biped')
    controller = make_controller(simulation.morphology, 'U-D', 'mlp', scale=0.0)
    episode = run_episode(simulation, controller, 10.0)
    assert abs(episode.velocity(5.0)) < 1e-3


# --- physics that leaves the finite numbers ---------------------------------------------------


def test_diverged_episode_scores_minus_infinity():
    simulation = Simulation('worm-2x1', **DIVERGING)
    controller = make_controller(simulation.morphology, 'U-D', 'mlp', scale=3.0)
    episode = run_episode(simulation, controller, 30.0)
    assert episode.diverged
    assert 1 < len(episode.centers) < 1801
    assert np.isfinite(episode.centers).all()
    assert simulation.step_count == len(episode.centers) - 1
    for transient in (0.0, 5.0):
        assert episode.velocity(transient) == -np.inf


def test_diverges_where_the_loop_does():
    simulation = Simulation('worm-2x1', **DIVERGING)
    controller = make_controller(simulation.morphology, 'U-D', 'mlp', scale=3.0)
    episode = run_episode(simulation, controller, 30.0)
    with pytest.raises(Diverged, match=rf'worm-2x1: .* step {len(episode.centers)}'):
        loop(simulation, controller, 1800)
    assert simulation.step_count == len(episode.centers) - 1


def test_simulation_is_sound_after_a_diverged_episode():
    simulation = Simulation('worm-2x1', **DIVERGING)
    controller = make_controller(simulation.morphology, 'U-D', 'mlp', scale=3.0)
    episodes = [run_episode(simulation, controller, 30.0) for _ in range(2)]
    np.testing.assert_array_equal(episodes[0].centers, episodes[1].centers)
    assert np.isfinite(simulation.reset()).all()
    assert np.isfinite(simulation.center).all()


@pytest.mark.parametrize(
    ('frequency', 'damping_ratio', 'iterations'), [(24.0, 0.3, 1), (30.0, 2.0, 10)]
)
def test_exploded_robot_is_no_fast_robot(frequency, damping_ratio, iterations):
    # Let alone, these stay finite for minutes, at 1e97 m/s and 1e4 m/s.
    simulation = Simulation(
        'worm-2x1',
        material=Material(frequency=frequency, damping_ratio=damping_ratio),
        solver=Solver(iterations=iterations, physics='first'),
    )
    controller = make_controller(simulation.morphology, 'U-D', 'mlp', seed=1, scale=3.0)
    velocity = run_episode(simulation, controller, 5.0).velocity(1.0)
    assert velocity == -np.inf or abs(velocity) < 100.0
