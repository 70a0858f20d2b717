"""Serialised messages: rclpy reads what we write, and invalid bytes are refused."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from nav_msgs.msg import Odometry
from rclpy.serialization import deserialize_message, serialize_message
from rosbags.typesys import Stores, get_typestore
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Image, JointState
from std_msgs.msg import Header
from visualization_msgs.msg import Marker, MarkerArray

from sim_node.control_time import stamp_of_step
from sim_node.drawing import area_colors
from sim_node.errors import InvalidInput
from sim_node.model.sensors import DEFAULT_SENSORS
from sim_node.ros import topics
from snca_ros.cell.architecture import Architecture
from snca_ros.nodes.cell_messages import CellMessages

settings.register_profile('steady', derandomize=True, deadline=None, database=None)
settings.load_profile('steady')

STEPS = st.integers(0, 2**31 * 60 - 1)
UNIT = st.floats(0.0, 1.0)
EPISODE = np.frombuffer(b'0123abcd', np.uint8)
ARCHITECTURES = [
    Architecture.named(name, model, n_c=n_c)
    for name in ('U-nD', 'U-D') for model in ('mlp', 'snn-h') for n_c in (1, 4, 7)
]


def strict(data, name):
    """Deserialise with rosbags, which also refuses bytes left over at the end."""
    return get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(data, name)


@given(STEPS, st.lists(UNIT, min_size=4, max_size=4))
def test_sensors_are_what_rclpy_reads(step, values):
    wire = topics.sensors_format('voxel_3_1', DEFAULT_SENSORS)
    data = wire.encode(
        stamp_of_step(step), position=np.array(values), episode=EPISODE
    )
    message = deserialize_message(data, JointState)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == stamp_of_step(step)
    assert message.header.frame_id == 'voxel_3_1@0123abcd'
    assert tuple(message.name) == DEFAULT_SENSORS
    assert message.position.tolist() == values
    assert strict(data, 'sensor_msgs/msg/JointState').position.tolist() == values
    read = topics.read_joint_state(
        topics.sensors_format('voxel_3_1', DEFAULT_SENSORS), data, 0.0, 1.0
    )
    assert read[:2] == (b'0123abcd', step)
    assert read[2].tolist() == values


@given(STEPS, st.lists(st.tuples(st.floats(-1.0, 1.0), st.integers(-1, 100)), min_size=1))
def test_the_applied_actuation_is_what_rclpy_reads(step, of_voxels):
    voxels = [f'voxel_{i}_0' for i in range(len(of_voxels))]
    applied, ages = (list(column) for column in zip(*of_voxels, strict=True))
    wire = topics.applied_format('duo', voxels)
    data = wire.encode(
        stamp_of_step(step), position=np.array(applied), effort=np.array(ages), episode=EPISODE
    )
    message = deserialize_message(data, JointState)
    assert (message.header.stamp.sec, message.header.stamp.nanosec) == stamp_of_step(step)
    assert message.header.frame_id == 'duo@0123abcd'
    assert (list(message.name), message.position.tolist()) == (voxels, applied)
    assert (message.effort.tolist(), len(message.velocity)) == (ages, 0)
    assert strict(data, 'sensor_msgs/msg/JointState').effort.tolist() == ages
    _, (found, told) = topics.applied_format('duo', voxels).decode(data, 'position', 'effort')
    assert (found.tolist(), told.tolist()) == (applied, ages)


@given(STEPS, st.floats(-1.0, 1.0))
def test_actuation_of_other_writers_is_read(step, a):
    message = JointState(name=['voxel_0_2'], position=[a])
    message.header.frame_id = 'voxel_0_2@0123abcd'
    message.header.stamp.sec, message.header.stamp.nanosec = stamp_of_step(step)
    wire = topics.actuation_format('voxel_0_2')
    ours = wire.encode(stamp_of_step(step), position=np.array([a]), episode=EPISODE)
    for data in (ours, ours):  # the second time by the short way
        assert topics.read_joint_state(wire, data, -1.0, 1.0)[2].tolist() == [a]
    assert deserialize_message(ours, JointState) == message


@pytest.mark.parametrize('architecture', ARCHITECTURES, ids=str)
def test_cell_messages_round_trip(architecture):
    rng = np.random.default_rng(0)
    shape = (architecture.n_destinations, architecture.n_c, architecture.message_width)
    sender = CellMessages(architecture, 'voxel_1_1')
    receiver = CellMessages(architecture, 'voxel_1_1')
    for step in range(5):
        sent = rng.uniform(-1.0, 1.0, shape)
        if architecture.spiking:
            sent = (sent > 0.0).astype(float)
        data = sender.encode(EPISODE, stamp_of_step(step), sent)
        image = deserialize_message(data, Image)
        assert image.encoding == ('mono8' if architecture.spiking else '64FC1')
        assert (image.height, image.width) == (shape[0] * shape[1], shape[2])
        assert len(image.data) == image.height * image.step
        assert strict(data, 'sensor_msgs/msg/Image').header.frame_id == 'voxel_1_1@0123abcd'
        *when, got = receiver.decode(data)
        assert when == [b'0123abcd', step]
        np.testing.assert_array_equal(got, sent)


@settings(max_examples=300)
@given(st.sampled_from(['joint', 'spikes', 'values']), st.data())
def test_damaged_messages_are_refused_or_harmless(kind, data):
    """Whatever bytes arrive: InvalidInput, or numbers in range; never another exception."""
    if kind == 'joint':
        wire = topics.actuation_format('voxel_0_0')
        good = wire.encode((0, 0), position=np.array([0.5]))
    else:
        architecture = Architecture.named('U-nD', 'snn' if kind == 'spikes' else 'mlp')
        wire = CellMessages(architecture, 'voxel_0_0')
        good = wire.encode(
            EPISODE, (0, 0), np.zeros((1, architecture.n_c, architecture.message_width))
        )
    how = data.draw(st.sampled_from(['cut', 'flip', 'random', 'longer']))
    if how == 'cut':
        bad = good[: data.draw(st.integers(0, len(good) - 1))]
    elif how == 'flip':
        i = data.draw(st.integers(0, len(good) - 1))
        bad = good[:i] + bytes([good[i] ^ data.draw(st.integers(1, 255))]) + good[i + 1 :]
    elif how == 'longer':
        bad = good + data.draw(st.binary(min_size=1, max_size=16))
    else:
        bad = data.draw(st.binary(max_size=200))
    try:
        if kind == 'joint':
            _, step, numbers = topics.read_joint_state(wire, bad, -1.0, 1.0)
        else:
            _, step, numbers = wire.decode(bad)
    except InvalidInput:
        return
    assert step >= 0
    assert (np.abs(numbers) <= 1.0).all()


def test_stamps_out_of_step_and_bad_numbers_are_named():
    wire = topics.sensors_format('voxel_0_0', DEFAULT_SENSORS)
    for stamp, values, expected in (
        ((0, 1), [0.5] * 4, 'stamp'),
        ((-1, 0), [0.5] * 4, 'stamp'),
        ((0, 0), [0.5, 0.5, np.nan, 0.5], 'position'),
        ((0, 0), [0.5, 0.5, 1.5, 0.5], 'position'),
    ):
        with pytest.raises(InvalidInput, match=expected):
            topics.read_joint_state(
                wire, wire.encode(stamp, position=np.array(values)), 0.0, 1.0
            )
    for changed, expected in (
        ({'name': ['a', 'b', 'c', 'd']}, 'name'),
        ({'position': [0.5] * 3}, 'position'),
        ({'velocity': [0.5] * 4}, 'velocity'),
        ({'header': Header(frame_id='voxel_0_0')}, 'frame_id'),
        ({'header': Header(frame_id='voxel_0_1@0123abcd')}, 'frame_id'),
    ):
        ours = Header(frame_id='voxel_0_0@0123abcd')
        message = JointState(
            **{'header': ours, 'name': list(DEFAULT_SENSORS), 'position': [0.5] * 4, **changed}
        )
        with pytest.raises(InvalidInput, match=expected):
            topics.read_joint_state(wire, serialize_message(message), 0.0, 1.0)


def test_clock_odometry_and_markers():
    clock = deserialize_message(topics.clock_format().encode(stamp_of_step(90)), Clock)
    assert (clock.clock.sec, clock.clock.nanosec) == (1, 500_000_000)
    data = topics.odometry_format('biped').encode(
        stamp_of_step(1), position=np.array([1.0, 0.0, 2.0]), velocity=np.array([3.0, 0.0, 4.0])
    )
    odometry = deserialize_message(data, Odometry)
    assert strict(data, 'nav_msgs/msg/Odometry').child_frame_id == 'biped'
    pose, twist = odometry.pose.pose, odometry.twist.twist.linear
    assert (pose.position.x, pose.position.y, pose.position.z) == (1.0, 0.0, 2.0)
    assert (twist.x, twist.y, twist.z) == (3.0, 0.0, 4.0)
    assert pose.orientation.w == 1.0
    corners = np.random.default_rng(0).uniform(0.0, 30.0, (3, 4, 2))
    ratios = np.array([0.8, 1.0, 1.2])
    data = topics.RobotMarkers(3).encode(corners, ratios)
    assert len(strict(data, 'visualization_msgs/msg/MarkerArray').markers) == 2
    voxels, outlines = deserialize_message(data, MarkerArray).markers
    assert voxels.type == Marker.TRIANGLE_LIST
    assert outlines.type == Marker.LINE_LIST
    points = np.array([(p.x, p.z) for p in voxels.points]).reshape(3, 6, 2)
    np.testing.assert_array_equal(points, corners[:, [0, 1, 2, 0, 2, 3]])
    lines = np.array([(p.x, p.z) for p in outlines.points]).reshape(3, 8, 2)
    np.testing.assert_array_equal(lines, corners[:, [0, 1, 1, 2, 2, 3, 3, 0]])
    colors = np.array([(c.r, c.g, c.b, c.a) for c in voxels.colors])[::6]
    np.testing.assert_allclose(colors, area_colors(ratios), rtol=1e-6)
