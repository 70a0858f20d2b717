"""Bags: both storages, real QoS profiles and type hashes, readable by any tool, hard to lose."""

import os
import resource
import signal

import numpy as np
import pytest
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader
from support.graph import go, offline
from support.limits import LIMIT

from snca_ros.controller_file import load_controller
from snca_ros.files import RESERVE
from snca_ros.graph.description import WalkOptions, describe_graph
from snca_ros.graph.processes import RunningGraph
from snca_ros.recording.bag import read_bag


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_bag_holds_the_graph(make_controller, node, spin_until, tmp_path, storage):
    path = make_controller('11-10')
    options = WalkOptions(
        robot='robot', duration=1.0, bag=str(tmp_path / 'bag'), storage=storage,
        voxels_per_process=2,
    )
    graph = describe_graph(path, load_controller(path), options)
    hashes = {}

    def look():
        for topic, _ in node.get_topic_names_and_types():
            for info in node.get_publishers_info_by_topic(topic):
                hashes[topic] = (info.topic_type, str(info.topic_type_hash))
        return running.exit_code(graph.simulation) is not None

    with RunningGraph(graph, {}) as running:
        spin_until(look)
        assert running.exit_code(graph.simulation) == 0

    assert all(count.lost == 0 for count in read_bag(tmp_path / 'bag').counts)
    voxels = [f'/robot/voxel_{v}' for v in ('0_0', '0_1', '1_1')]
    with Reader(tmp_path / 'bag') as reader:
        topics = {c.topic: c for c in reader.connections}
        counts = {c.topic: c.msgcount for c in reader.connections}
    for voxel in voxels:
        for kind in ('sensors', 'actuation', 'spikes'):
            assert counts[f'{voxel}/{kind}'] == 60
    assert counts['/robot/odometry'] == counts['/clock'] == 61
    assert counts['/robot/markers'] == 31 + 2  # the robot, and the ground once a second
    assert '/diagnostics' in topics
    for topic, connection in topics.items():
        if topic.startswith('/robot/voxel_') or topic in ('/clock', '/robot/odometry'):
            (qos,) = connection.ext.offered_qos_profiles
            assert qos.reliability == QosReliability.RELIABLE
            assert qos.durability == QosDurability.TRANSIENT_LOCAL
        if topic in hashes:
            message_type, type_hash = hashes[topic]
            assert connection.msgtype == message_type
            assert connection.digest in type_hash
    assert len([t for t in topics if t in hashes and t.startswith('/robot/')]) >= 9


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
def test_killed_recorder_leaves_all_but_the_last_second(
    make_controller, node, spin_until, centers, tmp_path, storage
):
    path = make_controller('11-10')
    options = WalkOptions(
        robot='robot', duration=0.0, real_time_factor=2.0, bag=str(tmp_path / 'bag'),
        storage=storage, voxels_per_process=3,
    )
    graph = describe_graph(path, load_controller(path), options)
    with RunningGraph(graph, {}) as running:
        spin_until(lambda: 120 in centers[0])
        newest = max(centers[0])
        spin_until(lambda: newest + 120 in centers[0])  # a second later, at twice real time
        os.kill(running.pids()[graph.recorder], signal.SIGKILL)
        running.wait(graph.recorder, LIMIT)
        spin_until(lambda: max(centers[0]) > newest + 300)
    bag = read_bag(tmp_path / 'bag')
    assert not bag.closed
    assert newest <= bag.n_steps - 1 <= max(centers[0])
    known = [centers[0][k] for k in range(newest + 1)]
    np.testing.assert_array_equal(bag.centers[: newest + 1], known)
    assert all(
        (count.missing > newest - 30).all() for count in bag.counts
        if count.missing is not None
    )


def limit_files(n_bytes):
    """Return a preexec function that limits the size of a child's files, like a small disk."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (n_bytes, n_bytes))


def test_recorder_ends_with_its_bag_closed_before_the_disk_is_full(
    walk, start, node, spin_until, centers, tmp_path
):
    _, _, path = walk(recorders=1)
    recorder = start(
        'recorder_node', '--ros-args', '-r', '__ns:=/robot', '-p', f'bag:={tmp_path / "bag"}',
        preexec_fn=limit_files(RESERVE + 300_000),
    )
    go(node, spin_until, centers)
    output, _ = recorder.communicate(timeout=LIMIT)
    assert recorder.returncode == 1, output
    assert 'cannot be written: only 1' in output
    assert 'Traceback' not in output
    bag = read_bag(tmp_path / 'bag')
    assert bag.closed
    assert bag.n_steps > 60
    np.testing.assert_array_equal(bag.centers[:61], offline(path, 1.0))
    assert all(
        (count.missing > bag.n_steps - 30).all() for count in bag.counts
        if count.missing is not None
    )


@pytest.mark.parametrize('command', ['walk', 'recorder_node'])
def test_a_disk_without_room_is_reported_before_anything_starts(
    start, make_controller, tmp_path, command
):
    arguments = {
        'walk': [make_controller(), '--bag', 'bag'],
        'recorder_node': ['--ros-args', '-p', 'bag:=bag'],
    }[command]
    child = start(command, *arguments, preexec_fn=limit_files(1_000_000))
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 2
    assert '1.0 MB of free space' in output
    assert len([line for line in output.splitlines() if 'error' in line]) == 1
    assert not (tmp_path / 'bag').exists()
