"""Bags with topics of other nodes, or of a second robot's clock, are read as the robot's walk."""

import numpy as np
import pytest
from rosbags.rosbag2 import Writer
from support.synthetic_bag import (
    STEP_TIME,
    STORAGES,
    STORE,
    count_of,
    make_walk,
    messages_of_walk,
    odometry,
    write_messages,
)

from snca_ros.recording.bag import read_bag

N_STEPS = 12


def test_the_clock_of_a_second_robot_is_read(tmp_path):
    walk = make_walk(N_STEPS)
    steps = [
        [(topic.replace('/clock', '/biped/clock'), message) for topic, message in step]
        for step in messages_of_walk(walk)
    ]
    bag = read_bag(write_messages(tmp_path / 'bag', steps))
    clock_count = count_of(bag, '/biped/clock')
    assert (clock_count.received, clock_count.lost) == (N_STEPS + 1, 0)
    assert '/clock' not in [count.topic for count in bag.counts]


def test_odometry_of_others_below_the_namespace_is_no_robot(tmp_path):
    steps = messages_of_walk(make_walk(N_STEPS))
    steps[3].append(('/biped/gps/odometry', odometry(0, np.array([5.0, 5.0]))))
    bag = read_bag(write_messages(tmp_path / 'bag', steps))
    np.testing.assert_array_equal(bag.centers, make_walk(N_STEPS).centers)


@pytest.mark.parametrize('storage', STORAGES)
def test_topics_without_definition_are_read_past(tmp_path, storage):
    path = tmp_path / 'bag'
    writer = Writer(path, version=9, storage_plugin=STORAGES[storage])
    writer.open()
    foreign = writer.add_connection(
        '/biped/thing', 'mine/msg/Thing', msgdef='', rihs01='RIHS01_' + '0' * 64
    )
    writer.write(foreign, 10**18, b'\0\1\2\3')
    for k, step in enumerate(messages_of_walk(make_walk(N_STEPS))):
        for topic, message in step:
            kind = message.__msgtype__
            connection = next((c for c in writer.connections if c.topic == topic), None)
            connection = connection or writer.add_connection(topic, kind, typestore=STORE)
            time = 10**18 + k * STEP_TIME
            writer.write(connection, time, STORE.serialize_cdr(message, kind))
    writer.close()
    bag = read_bag(path)
    np.testing.assert_array_equal(bag.centers, make_walk(N_STEPS).centers)
    assert count_of(bag, '/biped/thing').received == 1
