"""Bags: both storages, real QoS profiles and type hashes, readable by any tool."""

import pytest
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader

from snca_ros.controller_file import load_controller
from snca_ros.nodes.bringup import WalkOptions, describe_graph
from snca_ros.nodes.processes import RunningGraph
from snca_ros.study.bag import read_bag


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
