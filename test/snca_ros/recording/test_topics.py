"""Topics are found by their declared names, or, if they are remapped, by their content."""

import numpy as np
import pytest
from support.synthetic_bag import (
    TYPES,
    diagnostics,
    joint_state,
    make_walk,
    messages_of_walk,
    odometry,
    write_messages,
)

from sim_node.errors import InvalidInput
from snca_ros.recording.bag import read_bag

N_STEPS = 20
GROUND = np.array([[0.0, 5.0], [20.0, 5.0]])


def new_walk(seed=0):
    corners = np.random.default_rng(seed).normal(size=(N_STEPS + 1, 2, 4, 2))
    return make_walk(
        N_STEPS, seed=seed, corners=corners, ground=GROUND, ages=np.zeros((N_STEPS, 2))
    )


def renamed(messages, names):
    return [[(names.get(topic, topic), message) for topic, message in step] for step in messages]


def assert_is_walk(bag, walk):
    np.testing.assert_array_equal(bag.centers, walk.centers)
    np.testing.assert_array_equal(bag.readings[:-1], walk.readings)
    np.testing.assert_array_equal(bag.actuation[:-1], walk.actuation)
    np.testing.assert_array_equal(bag.spikes[:-1], walk.spikes)
    np.testing.assert_array_equal(bag.applied[:-1], walk.actuation)
    np.testing.assert_array_equal(bag.poses.corners, walk.corners[::2])
    assert sum(count.lost for count in bag.counts) == 0


@pytest.mark.parametrize('names', [
    {'/biped/odometry': '/biped/odom'},
    {'/clock': '/biped/clock'},
    {'/biped/odometry': '/odom', '/biped/markers': '/shapes'},
    {'/biped/voxel_0_0/sensors': '/biped/readings', '/biped/voxel_1_0/actuation': '/a',
     '/biped/voxel_0_0/spikes': '/biped/images', '/biped/applied_actuation': '/biped/joint_states'},
], ids=str)
def test_remapped_topics_are_followed(tmp_path, names):
    walk = new_walk()
    messages = renamed(messages_of_walk(walk), names)
    messages[3].append(('/diagnostics', diagnostics('/biped/voxel_0_0', {'steps': 3})))
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    assert bag.robot == 'biped'
    assert_is_walk(bag, walk)
    assert set(names.values()) <= {count.topic for count in bag.counts}
    assert list(bag.health) == ['voxel_0_0']


def test_declared_names_have_precedence(tmp_path):
    walk, other = new_walk(), new_walk(seed=1)
    messages = messages_of_walk(walk)
    for k in range(N_STEPS):
        copied = joint_state(k, 'voxel_0_0@r5f0c17e', ['voxel_0_0'], other.actuation[k, 0])
        messages[k].insert(0, ('/biped/a_copy', copied))
        messages[k].insert(0, ('/biped/wheels', odometry(k, other.centers[k])))
    messages[0].append(('/biped/joints', TYPES['std_msgs/msg/String']('nothing')))
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    assert_is_walk(bag, walk)


def test_the_clock_of_the_robot_is_taken_if_there_are_two(tmp_path):
    walk = new_walk()
    messages = renamed(messages_of_walk(walk), {'/clock': '/biped/clock'})
    for k, step in enumerate(messages):
        step.append(('/clock', messages[(k + 7) % N_STEPS][1][1]))
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    assert_is_walk(bag, walk)
    missing = {count.topic: count.missing for count in bag.counts}
    assert missing['/clock'] is None
    assert missing['/biped/clock'].size == 0


@pytest.mark.parametrize('name', ['/other/odometry', '/other/odom'])
def test_two_robots_are_refused(tmp_path, name):
    first, second = messages_of_walk(new_walk()), messages_of_walk(new_walk(1), 'other')
    second = renamed(second, {'/other/odometry': name})
    messages = [a + b for a, b in zip(first, second, strict=True)]
    with pytest.raises(InvalidInput, match=r'robot: got .odometry of biped, other'):
        read_bag(write_messages(tmp_path / 'bag', messages))
