"""Voxels in lock-step do what their offline twin does, whenever and however often things come."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.voxel_world import Robot, World

from snca_ros.faults import Faults
from snca_ros.nodes.voxel_core import Heard

N_STEPS = 10
ROBOTS = [
    Robot(), Robot('nU-nD'), Robot('U-nD', 'snn-h'), Robot('nU-D', 'snn'),
    Robot('U-D', faults=Faults(loss=0.4, delay=1, death='0.5@0.03-0.06', seed=3)),
]
N_EVENTS = 120
robots = st.sampled_from(ROBOTS)
chances = st.randoms(use_true_random=False)


def hold(world):
    """Check what always holds: the twins' actuation, and no answer twice in a life."""
    for number, rows in enumerate(world.actuation):
        if rows:
            np.testing.assert_array_equal(rows, world.expected(number))
    assert len(set(world.answers)) == len(world.answers)


def advance(world, chance):
    """Let one of the things happen that may."""
    chance.choice(world.events())()


@pytest.mark.parametrize('robot', ROBOTS)
def test_in_turn(robot):
    world = World(robot)
    world.finish(20)
    hold(world)
    assert np.ptp(world.actuation[0]) > 0.05
    for core in world.cores:
        for link in (core.sensors_link, *core.links.values()):
            assert link.on_time >= 19
            assert link.late == link.lost == 0


@settings(max_examples=50)
@given(robots, chances)
def test_any_delay_and_any_order_across_links(robot, chance):
    world = World(robot)
    for _ in range(N_EVENTS):
        advance(world, chance)
    world.finish(N_STEPS)
    hold(world)


@settings(max_examples=50)
@given(robots, chances)
def test_what_is_repeated_or_of_another_episode_changes_nothing(robot, chance):
    world = World(robot)
    poison = np.ones_like(robot.part(0).cells.outbox[0])
    for _ in range(N_EVENTS):
        advance(world, chance)
        i = chance.randrange(robot.n)
        core, sensors = world.cores[i], world.sensors[i]
        d, link = chance.choice([(d, link) for (j, d), link in world.messages.items() if j == i])
        kind = chance.choice(['nothing', 'sensors', 'message', 'foreign'])
        if kind == 'sensors' and sensors.taken:
            again = chance.choice(sensors.said[: sensors.taken])
            assert core.hear_sensors(*again, 0.0) is Heard.REPEATED
        if kind == 'message' and link.taken:
            core.hear_neighbor(d, *chance.choice(link.said[: link.taken]))
        if kind == 'foreign' and core.joined:
            core.hear_neighbor(d, b'deadbeef', max(core.step - chance.randrange(3), 0), poison)
        world.look(i)
    world.finish(N_STEPS)
    hold(world)


@settings(max_examples=50)
@given(robots, chances)
def test_killed_voxels_catch_up_and_resets_begin_afresh(robot, chance):
    """Whoever is started again is told all from the beginning and acts from the newest step on."""
    world = World(robot)
    for _ in range(N_EVENTS):
        advance(world, chance)
        kind, i = chance.choice([*['nothing'] * 28, 'kill', 'reset']), chance.randrange(robot.n)
        # A voxel that is killed also forgets the messages that a fault delays.
        if kind == 'kill' and world.may_be_killed(i) and not robot.faults.delay:
            world.kill(i)
        if kind == 'reset' and len(world.actuation) < 4:
            world.reset()
    world.finish(world.step + 3)
    hold(world)
    for episode, step, i in world.killed:
        later = [s for e, s, j, _ in world.answers if (e, j) == (episode, i) and s >= step]
        assert later == sorted(set(later)), 'a step was made twice'


def test_voxel_that_joins_in_mid_walk_is_in_step_with_the_others():
    robot = ROBOTS[2]
    world = World(robot)
    world.finish(50)
    while not world.may_be_killed(2):
        world.events()[0]()
    world.kill(2)
    world.finish(80)
    hold(world)
    assert [s for _, s, i, life in world.answers if (i, life) == (2, 1)][:3] == [50, 51, 52]
    assert not np.array_equal(world.actuation[0], robot.twin(80)), 'its cell has forgotten nothing'


def test_what_a_killed_voxel_said_last_and_nobody_heard_is_not_waited_for():
    world = World(ROBOTS[0])
    world.finish(10)
    while not world.may_be_killed(0):
        world.events()[0]()
    for (j, d), link in world.messages.items():
        if ROBOTS[0].morphology.neighbors[j, d] == 0:
            del link.said[link.taken:]  # its writer is gone
            link.said.pop()
            link.taken = len(link.said)
    world.kill(0)
    world.finish(30)
