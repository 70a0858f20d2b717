"""A strange item among the messages of a bag is counted, and the others are read."""

import shutil
from dataclasses import replace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from support.synthetic_bag import (
    STORE,
    clock,
    count_of,
    diagnostics,
    image,
    make_walk,
    messages_of_walk,
    write_messages,
)

from snca_ros.recording.bag import read_bag

N_STEPS = 12


def test_a_status_that_is_not_text_is_refused_and_the_others_are_read(tmp_path):
    messages = messages_of_walk(make_walk(3))
    array = diagnostics('/biped/voxel_0_0', {'steps': 3})
    array.status = [
        *diagnostics('/biped/voxel_0_1?', {}).status, *array.status,
        *diagnostics('/biped/sim_node', {'step?': 3, 'steps': 'many', 'load': 'nan'}).status,
    ]
    data = bytes(STORE.serialize_cdr(array, array.__msgtype__)).replace(b'?', b'\xff')
    messages[0].append(('/diagnostics', (data, array.__msgtype__)))
    messages[1].append(('/diagnostics', (data[:90], array.__msgtype__)))
    messages[2].append(('/diagnostics', diagnostics('/biped/voxel_1_0', {'steps': 2})))
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    assert {node: dict(health.values) for node, health in bag.health.items()} == {
        'voxel_0_0': {'steps': 3.0}, 'voxel_1_0': {'steps': 2.0}
    }
    assert count_of(bag, '/diagnostics').refused == 4  # two statuses, and one and a half again


def test_diagnostics_of_another_type_are_counted(tmp_path):
    messages = messages_of_walk(make_walk(3))
    messages[0].append(('/diagnostics', clock(3)))
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    assert (bag.health, count_of(bag, '/diagnostics').refused) == ({}, 1)


@settings(max_examples=40)
@given(data=st.data())
def test_a_strange_item_leaves_the_others_readable(tmp_path_factory, data):
    """Any process can publish anything on any topic, also before the robot's own nodes."""
    walk = replace(make_walk(N_STEPS), ages=np.zeros((N_STEPS, 2)))
    messages = messages_of_walk(walk)
    messages[3].append(('/diagnostics', diagnostics('/biped/sim_node', {'steps': 3})))
    all_ = [message for step in messages for message in step]
    topic, original = data.draw(st.sampled_from(all_), label='message')
    kind = original.__msgtype__
    content = bytearray(STORE.serialize_cdr(original, kind))
    if data.draw(st.booleans(), label='of its own type'):
        for _ in range(data.draw(st.integers(1, 3), label='changes')):
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
        content = content[: data.draw(st.integers(0, len(content)))] or content
    else:
        kind = data.draw(st.sampled_from(['std_msgs/msg/Header', 'sensor_msgs/msg/Image']))
    where = data.draw(st.integers(0, N_STEPS), label='step')
    messages[where].append((topic, (bytes(content), kind)))
    folder = tmp_path_factory.mktemp('strange')
    bag = read_bag(write_messages(folder / 'bag', messages))
    shutil.rmtree(folder)
    assert bag.n_steps == N_STEPS + 1
    assert bag.n_episodes == 1
    assert bag.voxel_names == walk.voxels
    for found, right in ((bag.centers, walk.centers), (bag.readings[:-1], walk.readings),
                         (bag.actuation[:-1], walk.actuation), (bag.spikes[:-1], walk.spikes)):
        differ = (found != right).reshape(len(right), -1).any(axis=1)
        assert differ.sum() <= 1  # a forged message of its step may have come first


def test_spikes_of_a_stranger_among_values_are_counted(tmp_path):
    values = np.random.default_rng(0).uniform(-1, 1, (N_STEPS, 2, 4))
    messages = messages_of_walk(replace(make_walk(N_STEPS), spikes=None, values=values))
    spikes = image(3, 'voxel_0_0@r5f0c17e', 'mono8', np.zeros((4, 16), np.uint8))
    messages[3].append(('/biped/voxel_0_0/spikes', spikes))
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    np.testing.assert_array_equal(bag.values[:-1], values)
    assert bag.spikes is None
    assert count_of(bag, '/biped/voxel_0_0/spikes').refused == 1
