"""Voxels in lock-step equal their offline twin, whatever messages are delayed or repeated."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.voxel_world import Robot, World

from snca_ros.faults import Faults
from snca_ros.nodes.voxel_core import SensorsResult

N_STEPS = 10
ROBOTS = [
    Robot(), Robot('nU-nD'), Robot('U-nD', 'snn-h'), Robot('nU-D', 'snn'),
    Robot('U-D', faults=Faults(loss=0.4, delay=1, death='0.5@0.03-0.06', seed=3)),
]
N_EVENTS = 120
robots = st.sampled_from(ROBOTS)
chances = st.randoms(use_true_random=False)


def check(world):
    """Check what must always hold: the twin's actuation, and one answer per step and process."""
    for number, rows in enumerate(world.actuation):
        if rows:
            np.testing.assert_array_equal(rows, world.expected(number))
    assert len(set(world.answers)) == len(world.answers)


def advance(world, chance):
    """Execute one of the possible events."""
    chance.choice(world.events())()


@pytest.mark.parametrize('robot', ROBOTS)
def test_in_turn(robot):
    world = World(robot)
    world.finish(20)
    check(world)
    assert np.ptp(world.actuation[0]) > 0.05
    for core in world.cores:
        for link in (core.sensors_delivery, *core.deliveries.values()):
            assert link.on_time >= 19
            assert link.late == link.lost == 0


@settings(max_examples=50)
@given(robots, chances)
def test_any_delay_and_any_order_across_links(robot, chance):
    world = World(robot)
    for _ in range(N_EVENTS):
        advance(world, chance)
    world.finish(N_STEPS)
    check(world)


@settings(max_examples=50)
@given(robots, chances)
def test_repeated_messages_and_other_episodes_change_nothing(robot, chance):
    world = World(robot)
    cell = robot.architecture
    poison = np.ones((cell.n_destinations, cell.n_c, cell.message_width))
    for _ in range(N_EVENTS):
        advance(world, chance)
        i = chance.randrange(robot.n)
        core, sensors = world.cores[i], world.sensors[i]
        d, link = chance.choice([(d, link) for (j, d), link in world.messages.items() if j == i])
        kind = chance.choice(['nothing', 'sensors', 'message', 'foreign'])
        if kind == 'sensors' and sensors.taken:
            again = chance.choice(sensors.sent[: sensors.taken])
            assert core.receive_sensors(*again, 0.0) is SensorsResult.REPEATED
        if kind == 'message' and link.taken:
            core.receive_message(d, *chance.choice(link.sent[: link.taken]))
        if kind == 'foreign' and core.joined:
            core.receive_message(d, b'deadbeef', max(core.step - chance.randrange(3), 0), poison)
        world.step_voxel(i)
    world.finish(N_STEPS)
    check(world)


@settings(max_examples=50)
@given(robots, chances)
def test_killed_voxels_rejoin_and_resets_begin_a_new_episode(robot, chance):
    """A restarted voxel receives all messages from the first, and acts from the newest step on."""
    world = World(robot)
    for _ in range(N_EVENTS):
        advance(world, chance)
        kind, i = chance.choice([*['nothing'] * 28, 'kill', 'reset']), chance.randrange(robot.n)
        # A killed voxel also loses the messages that the fault `delay` holds back.
        if kind == 'kill' and world.may_be_killed(i) and not robot.faults.delay:
            world.kill(i)
        if kind == 'reset' and len(world.actuation) < 4:
            world.reset()
    world.finish(world.step + 3)
    check(world)
    for episode, step, i in world.killed:
        later = [s for e, s, j, _ in world.answers if (e, j) == (episode, i) and s >= step]
        assert later == sorted(set(later)), 'a step was made twice'


def test_a_voxel_that_joins_during_a_walk_is_in_step_with_the_others():
    robot = ROBOTS[2]
    world = World(robot)
    world.finish(50)
    while not world.may_be_killed(2):
        world.events()[0]()
    world.kill(2)
    world.finish(80)
    check(world)
    assert [s for _, s, i, start in world.answers if (i, start) == (2, 1)][:3] == [50, 51, 52]
    assert not np.array_equal(world.actuation[0], robot.twin(80)), 'its cell was not reset'


def test_the_lost_last_message_of_a_killed_voxel_is_not_awaited():
    world = World(ROBOTS[0])
    world.finish(10)
    while not world.may_be_killed(0):
        world.events()[0]()
    for (j, d), link in world.messages.items():
        if ROBOTS[0].morphology.neighbors[j, d] == 0:
            del link.sent[link.taken:]  # its writer is gone
            link.sent.pop()
            link.taken = len(link.sent)
    world.kill(0)
    world.finish(30)
