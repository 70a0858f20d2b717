"""Layouts of messages, compared with messages that rosbags serialises from their definitions."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from support.synthetic_bag import STORE, clock, image, joint_state, markers, odometry

from sim_node import message_layout
from sim_node.control_time import stamp_of_step

VOXELS = st.builds('voxel_{}_{}'.format, st.integers(0, 10**4), st.integers(0, 10**4))
EPISODE = b'r5f0c17e'
STEPS = st.integers(0, 10**6)
WORDS = st.text(st.characters(codec='utf-8', exclude_characters='\0'), max_size=9)

settings.register_profile('steady', derandomize=True, deadline=None, database=None)
settings.load_profile('steady')


def fields_of(message, layout: np.dtype) -> np.ndarray:
    """Return a message, serialised by rosbags, as an item of `layout`; assert equal lengths."""
    data = STORE.serialize_cdr(message, message.__msgtype__)
    assert len(data) == layout.itemsize
    return np.frombuffer(data, layout)[0]


def stamp(fields: np.ndarray) -> tuple[int, int]:
    return fields['sec'], fields['nanosec']


@given(STEPS, VOXELS, st.lists(WORDS, min_size=1, max_size=5))
def test_joint_states(step, voxel, names):
    numbers = np.arange(len(names)) / 7.0
    message = joint_state(step, f'{voxel}@{EPISODE.decode()}', names, numbers)
    fields = fields_of(message, message_layout.joint_state(voxel, EPISODE, names))
    assert stamp(fields) == stamp_of_step(step)
    assert fields['episode'].tobytes() == EPISODE
    assert [fields[f'name.{i}'].decode() for i in range(len(names))] == names
    np.testing.assert_array_equal(fields['position'], numbers)
    assert fields['velocity.size'] == fields['effort.size'] == 0
    message = joint_state(step, f'{voxel}@{EPISODE.decode()}', names, numbers, -numbers)
    layout = message_layout.joint_state(voxel, EPISODE, names, len(names))
    np.testing.assert_array_equal(fields_of(message, layout)['effort'], -numbers)


@given(STEPS, VOXELS, st.sampled_from(['mono8', '64FC1']), st.integers(1, 30))
def test_images(step, voxel, encoding, rows):
    pixels = np.arange(16.0 * rows).reshape(rows, 16)
    pixels = pixels.astype(np.uint8) if encoding == 'mono8' else pixels
    message = image(step, f'{voxel}@{EPISODE.decode()}', encoding, pixels)
    fields = fields_of(message, message_layout.image(voxel, EPISODE, encoding, pixels.nbytes))
    assert stamp(fields) == stamp_of_step(step)
    assert fields['episode'].tobytes() == EPISODE
    assert (fields['height'], fields['step']) == (rows, pixels.strides[0])
    assert fields['data'].tobytes() == pixels.tobytes()


@given(STEPS)
def test_clock_and_odometry(step):
    assert stamp(fields_of(clock(step), message_layout.clock())) == stamp_of_step(step)
    fields = fields_of(
        odometry(step, np.array([1.5, 2.5])), message_layout.odometry('world', 'biped')
    )
    assert stamp(fields) == stamp_of_step(step)
    assert fields['position'].tolist() == [1.5, 0.0, 2.5]
    assert fields['orientation'].tolist() == [0.0, 0.0, 0.0, 1.0]


@given(st.dictionaries(WORDS, st.integers(0, 9), max_size=3))
def test_markers(counts):
    points = {name: np.arange(2.0 * n).reshape(n, 2) for name, n in counts.items()}
    layout = message_layout.markers(*(('world', name, n, 0) for name, n in counts.items()))
    fields = fields_of(markers(points), layout)
    for name, places in points.items():
        np.testing.assert_array_equal(fields[f'{name}_points'][:, [0, 2]], places)
