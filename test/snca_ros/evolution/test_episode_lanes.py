"""Episodes side by side are the episodes one by one."""

import numpy as np
import pytest

from sim_node.batched.engine import Robots
from sim_node.simulation import Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller
from snca_ros.evolution.episode import run_episode
from snca_ros.evolution.episode_lanes import run_episodes


def _robots(like: Simulation) -> Robots:
    return Robots(like.morphology, like.terrain, like.material, like.solver)


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
