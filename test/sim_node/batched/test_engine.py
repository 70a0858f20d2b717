"""Results of a robot do not depend on the lanes of the batched engine, to the bit."""

from dataclasses import asdict

import numpy as np
import pytest

from sim_node.batched.engine import Robots
from sim_node.errors import InvalidInput
from sim_node.model.body_faults import FaultsOfBody
from sim_node.model.material import Material
from sim_node.model.morphology import parse_morphology
from sim_node.model.solver import Solver
from sim_node.model.terrain import parse_terrain
from sim_node.simulation import Simulation


def _robots(shape: str, terrain: str, width: int) -> Robots:
    return Robots(parse_morphology(shape), parse_terrain(terrain), Material(), Solver(), width)


def _run(robots: Robots, actuation: np.ndarray) -> list[bytes]:
    """Reset the robots and apply actuation, (n_steps, n_voxels, W); return as `_states`."""
    robots.reset()
    return _states(robots, actuation)


def _states(robots: Robots, actuation: np.ndarray) -> list[bytes]:
    """Apply actuation without a reset; return readings and masses of all steps of each robot."""
    seen: list[list[np.ndarray]] = [[] for _ in range(actuation.shape[2])]
    for values in actuation:
        readings = robots.step(values)
        for lane, own in enumerate(seen):
            own += [readings[:, :, lane], robots.group.mass_lanes[:, :, lane].copy()]
    return [b''.join(array.tobytes() for array in own) for own in seen]


def _gaits(n_robots: int, n_voxels: int, n_steps: int) -> np.ndarray:
    """Return different gaits: some robots jump, some rest, some walk back to the wall."""
    rng = np.random.default_rng(5)
    frequency, phase = rng.uniform(0.0, 6.0, n_robots), rng.uniform(0.0, 7.0, (n_voxels, n_robots))
    size = np.linspace(0.0, 1.5, n_robots)  # beyond 1 it is clipped
    t = np.arange(n_steps)[:, None, None] / 60.0
    return size * np.sin(2.0 * np.pi * frequency * t + phase)


@pytest.mark.parametrize(
    ('shape', 'terrain'), [('biped', 'flat'), ('worm', 'uphill-30'), ('11', 'steppy-0.3-1-2')]
)
def test_results_depend_neither_on_width_nor_on_lane_nor_on_other_robots(shape, terrain):
    gaits = _gaits(16, parse_morphology(shape).n_voxels, 300)
    together = _run(_robots(shape, terrain, 16), gaits)
    assert len(set(together)) == 16
    order = np.random.default_rng(6).permutation(16)
    shuffled = _run(_robots(shape, terrain, 16), gaits[:, :, order])
    assert shuffled == [together[i] for i in order]
    alone = _robots(shape, terrain, 1)
    for i in (0, 7, 15):
        assert _run(alone, gaits[:, :, i : i + 1]) == [together[i]]


def test_a_robot_that_diverges_does_not_affect_the_others():
    gaits = _gaits(16, 2, 60)
    expected = _run(_robots('11', 'flat', 16), gaits)
    robots = _robots('11', 'flat', 16)
    seen, others = [], np.arange(16) != 2
    for k, values in enumerate(gaits):
        if k == 30:
            robots.group.mass_lanes[3, 0, 2] = np.nan
        readings = robots.step(values)
        assert robots.sane[others].all()
        assert robots.sane[2] == (k < 30)
        seen.append([readings, robots.group.mass_lanes.copy()])
    for lane in np.flatnonzero(others):
        own = b''.join(array[..., lane].tobytes() for step in seen for array in step)
        assert own == expected[lane]


def test_simulation_gives_the_results_of_a_lane():
    robots, simulation = _robots('biped', 'flat', 16), Simulation('biped', engine='batched')
    gaits = _gaits(16, 10, 60)
    robots.reset()
    for values in gaits:
        readings, own = robots.step(values), simulation.step(values[:, 9])
        np.testing.assert_array_equal(own, readings[:, :, 9])
    np.testing.assert_array_equal(simulation.world.masses, robots.group.mass_lanes[:, :5, 9])


def test_a_push_is_given_to_the_reset_or_to_the_robots():
    gaits = _gaits(1, 2, 30)
    arguments = parse_morphology('11'), parse_terrain('flat'), Material(), Solver(), 1
    pushed, robots = Robots(*arguments, push=3), Robots(*arguments)
    expected = _run(pushed, gaits)
    exact = _run(robots, gaits)
    assert exact != expected
    robots.reset(3)
    assert _states(robots, gaits) == expected
    pushed.reset(0)
    assert _states(pushed, gaits) == exact == _run(robots, gaits)
    assert _run(pushed, gaits) == expected
    masses = Simulation('11', engine='batched', push=3).world.masses
    robots.reset(3)
    np.testing.assert_array_equal(robots.group.mass_lanes[:, :5, 0], masses)


FAULTS = [
    FaultsOfBody(),
    FaultsOfBody(sensor_noise=0.1, broken_actuators='frozen:0.5@0.2-0.4', seed=3),
    FaultsOfBody(broken_sensors='random:voxel_1_0@0.1', sensor_noise=0.02, seed=1),
    FaultsOfBody(broken_sensors='frozen:1@0.3', broken_actuators='zero:voxel_0_0@0.1-0.2'),
]


@pytest.mark.parametrize('n', [4, 3])
def test_robots_with_starts_and_faults_of_their_own_are_simulations_of_one(n):
    robots, gaits = _robots('11', 'flat', 4), _gaits(4, 2, 40)
    pushes, faults = [0, 5, 6, 7][:n], FAULTS[:n]
    for _ in range(2):  # the second time is not another
        robots.reset(pushes, faults)
        alone = [
            Simulation('11', engine='batched', push=push, **asdict(own))
            for push, own in zip([*pushes, 0][:4], [*faults, FAULTS[0]][:4], strict=True)
        ]
        readings = [one.reset() for one in alone]
        for values in gaits:
            for lane, expected in enumerate(readings):
                np.testing.assert_array_equal(robots.readings[..., lane], expected)
            robots.step(values)
            readings = [one.step(values[:, lane]) for lane, one in enumerate(alone)]
            acted = np.stack([one.world.actuation for one in alone], axis=-1)
            np.testing.assert_array_equal(robots.group.actuation_lanes[:, 0], acted)
    exact = _run(robots, gaits)
    assert exact == _run(_robots('11', 'flat', 4), gaits)


def test_only_faults_that_a_robot_has_are_drawn():
    robots = _robots('11', 'flat', 4)
    assert [part.shape[1] for part in robots.disturbance(5)] == [0, 0, 0]
    robots.reset(faults=FAULTS[1:2])
    assert [part.shape for part in robots.disturbance(5)] == [
        (5, 2, 1, 4), (5, 2, 4, 4), (5, 0, 4, 4)
    ]
    with pytest.raises(InvalidInput, match='pushes'):
        robots.reset([0] * 5)
    with pytest.raises(InvalidInput, match='faults'):
        robots.reset(faults=FAULTS * 2)


def test_arrays_of_simulation_agree_with_the_pymunk_engine():
    reference, batched = Simulation('11', engine='pymunk'), Simulation('11', engine='batched')
    for _ in range(30):
        reference.step(np.array([1.0, -0.5]))
        batched.step(np.array([1.0, -0.5]))
    np.testing.assert_allclose(batched.readings, reference.readings, atol=1e-9)
    for name in ('masses', 'corners', 'area_ratios', 'touching', 'actuation'):
        expected, got = getattr(reference.world, name), getattr(batched.world, name)
        np.testing.assert_allclose(got, expected, atol=1e-9, err_msg=name)
    np.testing.assert_allclose(batched.velocity, reference.velocity, atol=1e-9)
    first = batched.reset()
    np.testing.assert_array_equal(first, Simulation('11', engine='batched').reset())
    assert batched.step_count == 0
