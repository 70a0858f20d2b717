"""Agreement of the batched engine with the pymunk engine, the reference."""

import numpy as np
import pymunk
import pytest

from sim_node.batched.state import BOX_GROWTH, JOINT_ERROR
from sim_node.errors import InvalidInput
from sim_node.model.material import Material
from sim_node.model.physics import PHYSICS
from sim_node.model.solver import Solver
from sim_node.simulation import Simulation

FIRST = Solver(physics='first')

SHAPES = ['1', '11-11', 'biped', 'comb', 'worm', 'ball-5']


def still(k: int, n: int) -> np.ndarray:
    return np.zeros(n)


def sines(k: int, n: int) -> np.ndarray:
    """Return a sine of 1 Hz with a phase shift from voxel to voxel."""
    return np.sin(2.0 * np.pi * k / 60.0 + 0.7 * np.arange(n))


def flips(k: int, n: int) -> np.ndarray:
    """Return full contraction or expansion of each voxel at random, new ten times a second."""
    return np.random.default_rng(k // 6).choice([-1.0, 1.0], n)


def gap(shape, terrain, actuation, seconds, **options) -> np.ndarray:
    """Return the largest difference of position [m] or angle [rad] at each step, (n_steps,)."""
    reference = Simulation(shape, terrain, **options)
    batched = Simulation(shape, terrain, engine='batched', **options)
    n = reference.morphology.n_voxels
    assert np.array_equal(batched.world.masses, reference.world.masses)
    gaps = []
    for k in range(round(60 * seconds)):
        expected, got = reference.step(actuation(k, n)), batched.step(actuation(k, n))
        gaps.append(np.abs(batched.world.masses - reference.world.masses)[:, :3].max())
        if gaps[-1] < 1e-6:
            np.testing.assert_allclose(got, expected, atol=1e-4, rtol=0.0)
            assert np.array_equal(batched.world.touching, reference.world.touching)
            np.testing.assert_allclose(batched.center, reference.center, atol=1e-6)
    return np.array(gaps)


def test_constants_of_munk2d():
    space, body = pymunk.Space(), pymunk.Body(1.0, 1.0)
    joint = pymunk.PivotJoint(body, space.static_body, (0, 0), (0, 0))
    assert joint.error_bias == space.collision_bias == JOINT_ERROR
    assert space.collision_slop == PHYSICS['first'].slop == BOX_GROWTH
    assert space.collision_persistence == 3


def test_free_fall_and_the_step_response_of_a_voxel():
    no_gravity = {'material': Material(gravity=0.0)}  # it stays above the ground
    assert gap('1', 'flat', still, 0.4).max() < 2e-14
    assert gap('1', 'flat', lambda k, n: np.ones(n), 2.0, **no_gravity).max() < 1e-13
    assert gap('1', 'flat', lambda k, n: -np.ones(n), 2.0, **no_gravity).max() < 1e-13


@pytest.mark.parametrize('shape', SHAPES)
def test_rest(shape):
    assert gap(shape, 'flat', still, 20.0)[-1] < 1e-8


@pytest.mark.parametrize('terrain', ['flat', 'uphill-10', 'downhill-10'])
@pytest.mark.parametrize('shape', SHAPES)
def test_ten_seconds_of_a_wave(shape, terrain):
    assert gap(shape, terrain, sines, 10.0).max() < 1e-7


@pytest.mark.parametrize('terrain', ['flat', 'uphill-10', 'steppy-0.3-1-2'])
@pytest.mark.parametrize('actuation', [still, sines, flips])
def test_the_first_physics(terrain, actuation):
    assert gap('biped', terrain, actuation, 2.5, solver=FIRST).max() < 1e-6


@pytest.mark.parametrize('shape', ['1', 'biped', 'worm'])
@pytest.mark.parametrize(
    'terrain', ['hilly-1-10-0', 'hilly-2-2-1', 'steppy-0.5-10-0', 'steppy-0.3-1-2']
)
def test_rough_ground_and_random_full_actuation(shape, terrain):
    assert gap(shape, terrain, flips, 2.5).max() < 1e-6


@pytest.mark.parametrize('shape', ['1', 'biped', 'worm'])
def test_the_left_wall(shape):
    slippery = Material(friction=0.1)
    simulation = Simulation(shape, 'uphill-30', material=slippery)
    n, n_steps_there = simulation.morphology.n_voxels, 0
    for k in range(240):
        simulation.step(flips(k, n))
        n_steps_there += bool(simulation.world.corners[:, :, 0].min() < simulation.terrain.start)
    assert n_steps_there > 20
    assert gap(shape, 'uphill-30', flips, 4.0, material=slippery).max() < 1e-5


@pytest.mark.parametrize('solver', [Solver(substeps=3), Solver(iterations=4)])
def test_sub_steps_and_iterations(solver):
    assert gap('biped', 'flat', sines, 2.0, solver=solver).max() < 1e-9


@pytest.mark.parametrize(
    'material',
    [
        Material(side=1.5, mass_ratio=0.3, density=2.0),
        Material(frequency=14.0, damping_ratio=1.0),
        Material(damping_ratio=0.1, damping=0.0, restitution=0.7),
        Material(friction=0.0, gravity=20.0),
    ],
)
def test_materials(material):
    assert gap('11-11', 'uphill-5', sines, 1.5, material=material).max() < 1e-7


def test_noise_and_seed_are_those_of_the_pymunk_engine():
    reference, batched = (
        Simulation('11', sensor_noise=0.1, seed=3, engine=engine)
        for engine in ('pymunk', 'batched')
    )
    np.testing.assert_allclose(batched.reset(), reference.reset(), atol=1e-12)
    for k in range(20):
        np.testing.assert_allclose(
            batched.step(sines(k, 2)), reference.step(sines(k, 2)), atol=1e-9
        )


def test_the_error_for_self_collision_names_the_engine_that_has_it():
    with pytest.raises(InvalidInput, match='pymunk engine'):
        Simulation('biped', solver=Solver(self_collision=True), engine='batched')


def test_unknown_engine():
    with pytest.raises(InvalidInput, match=r"did you mean 'batched'"):
        Simulation('biped', engine='batchd')
