"""Episodes side by side are the episodes one by one."""

import numpy as np
import pytest

from sim_node.batched.engine import WIDTH, Robots
from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from sim_node.simulation import Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller
from snca_ros.evolution import episode_lanes
from snca_ros.evolution.episode import run_episode
from snca_ros.evolution.episode_lanes import run_episodes
from snca_ros.faults import parse_faults


def _robots(like: Simulation, width: int = WIDTH) -> Robots:
    return Robots(like.morphology, like.terrain, like.material, like.solver, width)


@pytest.mark.parametrize(
    ('name', 'model'), [('U-nD', 'snn-h'), ('nU-D', 'mlp'), ('nU-nD', 'snn')]
)
def test_episodes_of_a_crowd(name, model):
    architecture = Architecture.named(name, model)
    reference = Simulation('111-101')
    n = reference.morphology.n_voxels
    thetas = np.random.default_rng(0).uniform(-1.0, 1.0, (5, architecture.n_parameters(n)))
    robots = _robots(reference)
    together = run_episodes(robots, architecture, reference.morphology, thetas[:3], 5.0)
    others = run_episodes(robots, architecture, reference.morphology, thetas[::-1], 5.0)
    assert (len(together), len(others)) == (3, 5)
    for theta, episode, elsewhere in zip(thetas, together, others[::-1], strict=False):
        np.testing.assert_array_equal(elsewhere.centers, episode.centers)
        controller = Controller(architecture, reference.morphology, theta)
        in_pymunk = run_episode(reference, controller, 5.0)
        assert not episode.diverged
        np.testing.assert_allclose(episode.centers, in_pymunk.centers, atol=1e-3)


def test_the_stepwise_loop_is_the_fused_one():
    architecture = Architecture.named('U-nD', 'snn-h')
    simulation = Simulation('biped', engine='batched')
    morphology = simulation.morphology
    theta = np.random.default_rng(1).uniform(-1.0, 1.0, architecture.n_parameters(10))
    episode, = run_episodes(_robots(simulation), architecture, morphology, theta[None], 3.0)
    controller = Controller(architecture, morphology, theta)
    readings = simulation.reset()
    for k in range(180):
        np.testing.assert_array_equal(episode.centers[k], simulation.center)
        readings = simulation.step(controller.step(readings))


FAULTS = [parse_faults(text) for text in (
    'loss=0.3,seed=1', '', 'delay=2', 'death=0.4@0.3-0.9,seed=4',
    'sensor_noise=0.05,seed=2', 'broken_sensors=frozen:0.5@0.2-1', '',
    'broken_sensors=random:0.3@0.1,seed=5',
    'broken_actuators=frozen:0.5@0.5', 'broken_actuators=random:1@0.2-0.8,seed=6',
    'loss=1,broken_sensors=zero:1', 'loss=0.2,delay=5,death=0.5@0.2-0.5,sensor_noise=0.02,'
    'broken_sensors=frozen:voxel_0_0,broken_actuators=zero:voxel_2_1@0.7,seed=9',
)]
"""Faults of the robots of three groups of four; each group has different ones."""


@pytest.mark.parametrize(('name', 'model', 'records'), [
    ('U-nD', 'snn-h', ('actuation',)), ('nU-D', 'snn-h', ('actuation',)),
    ('U-D', 'mlp', ()), ('nU-nD', 'mlp', ()),
])
def test_faults_and_starts_of_their_own(name, model, records, monkeypatch):
    monkeypatch.setattr(episode_lanes, 'STEPS_DRAWN', 50)
    architecture, morphology = Architecture.named(name, model), parse_morphology('111-101')
    thetas = np.random.default_rng(2).uniform(-2.0, 2.0, (12, architecture.n_parameters(5)))
    robots, pushes = _robots(Simulation(morphology), 4), [*range(12)]
    together = []
    for i in (0, 4, 8):
        group = slice(i, i + 4)
        together += run_episodes(
            robots, architecture, morphology, thetas[group], 2.0, pushes[group], FAULTS[group],
            records,
        )
    walks = set()
    for theta, push, faults, episode in zip(thetas, pushes, FAULTS, together, strict=True):
        alone = Simulation(morphology, engine='batched', push=push, **faults.of_body)
        controller = Controller(architecture, morphology, theta, faults)
        expected = run_episode(alone, controller, 2.0, records)
        np.testing.assert_array_equal(episode.centers, expected.centers, str(faults))
        assert {*episode.records} == {*records}
        for record in records:
            np.testing.assert_array_equal(episode.records[record], expected.records[record])
        sound = run_episode(
            Simulation(morphology, engine='batched', push=push),
            Controller(architecture, morphology, theta), 2.0,
        )
        walks.add(np.array_equal(episode.centers, sound.centers) == (not faults.any))
    assert walks == {True}  # every fault matters, and only a fault does


def test_one_start_and_one_description_of_faults_are_those_of_all():
    architecture, morphology = Architecture.named('U-D', 'mlp'), parse_morphology('worm-3x1')
    thetas = np.random.default_rng(4).uniform(-1.0, 1.0, (3, architecture.n_parameters(3)))
    robots, faults = _robots(Simulation(morphology), 4), parse_faults('loss=0.5,seed=3')
    one, several = (
        run_episodes(robots, architecture, morphology, thetas, 1.0, *conditions)
        for conditions in ((7, faults), ([7] * 3, [faults] * 3))
    )
    for a, b in zip(one, several, strict=True):
        np.testing.assert_array_equal(a.centers, b.centers)


@pytest.mark.parametrize(('pushes', 'faults', 'field'), [
    (0, [parse_faults('')] * 2, 'faults'), ([0] * 5, parse_faults(''), 'pushes'),
    (0, parse_faults('death=voxel_9_9'), 'voxel_9_9'),
    (0, parse_faults('broken_sensors=zero:voxel_9_9'), 'voxel_9_9'),
])
def test_conditions_that_do_not_fit_are_named(pushes, faults, field):
    architecture, morphology = Architecture.named('U-D', 'mlp'), parse_morphology('worm-3x1')
    thetas = np.zeros((3, architecture.n_parameters(3)))
    with pytest.raises(InvalidInput, match=field):
        run_episodes(
            _robots(Simulation(morphology), 4), architecture, morphology, thetas, 1.0, pushes,
            faults,
        )
