"""How many control steps a duration has: one answer, which everything that runs a robot gives."""

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_node.batched.engine import Robots
from sim_node.control_time import stamp_of_step, step_of_stamp, steps_in
from sim_node.model.body_faults import parse_outage
from sim_node.simulation import Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller
from snca_ros.evolution.episode import mean_velocity, run_episode
from snca_ros.evolution.episode_lanes import run_episodes
from snca_ros.recording.gait import steady_part
from snca_ros.recording.offline import record_episode

MLP = Architecture.named('U-D', 'mlp')


def test_every_hundredth_of_a_second_has_the_nearest_number_of_steps():
    for k in range(200_001):
        n = steps_in(k / 100)
        assert abs(10 * n - 6 * k) <= 4, k  # 60 * k / 100, in tenths of a step


@pytest.mark.parametrize(('seconds', 'n'), [
    (4.15, 249), (np.float64(4.15), 249), (1.1, 66), (30, 1800), (0.0, 0), (1 / 60, 1),
    (0.025, 2), (0.075, 4), (1.075, 64), (1e9, 60_000_000_000),
])
def test_a_decimal_number_is_meant_as_it_is_written(seconds, n):
    assert steps_in(seconds) == n


@given(st.floats(0.0, 1e9))
def test_any_time_has_the_nearest_step(seconds):
    n = steps_in(seconds)
    assert abs(Fraction(str(seconds)) * 60 - n) <= Fraction(1, 2)
    assert steps_in(n / 60) == n
    if n < 2**31:
        assert step_of_stamp(*stamp_of_step(n)) == n


@pytest.fixture(scope='module')
def simulation():
    return Simulation('1')


@pytest.fixture(scope='module')
def robots(simulation):
    parts = simulation.morphology, simulation.terrain, simulation.material, simulation.solver
    return Robots(*parts, 1)


@settings(max_examples=20)
@given(st.integers(5, 450).map(lambda k: k / 100) | st.floats(0.05, 0.5))
def test_all_that_run_a_robot_agree(simulation, robots, seconds):
    n = steps_in(seconds)
    parameters = np.zeros(MLP.n_parameters(1))
    controller = Controller(MLP, simulation.morphology, parameters)
    fast = run_episode(simulation, controller, seconds)
    slow = record_episode(simulation, controller, seconds, ('actuation',))
    (lane,) = run_episodes(robots, MLP, simulation.morphology, parameters[None], seconds)
    assert len(fast.centers) == len(slow.centers) == len(lane.centers) == n + 1
    assert len(slow.actuation) == n

    begun = np.zeros(n + 3)
    begun[n:] = [0.0, 1.0, 2.0]  # it walks from the end of the transient on
    assert mean_velocity(begun, seconds) == 60.0
    assert len(steady_part(np.zeros((n + 5, 1)), seconds)) == 5
    outage = parse_outage('death', f'1@{seconds:.17f}')
    assert outage.covers(np.arange(n + 2)).tolist() == [False] * n + [True] * 2
