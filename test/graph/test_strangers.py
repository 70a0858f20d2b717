"""Others in a robot's namespace: bags that are played, second simulations, types of other projects.

None of them changes what the robot does or ends a node, and the diagnostics name them.
"""

import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from actionlib_msgs.msg import GoalID
from nav_msgs.msg import Goals, Odometry
from rclpy.duration import Duration
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rosbags.rosbag2 import Reader
from rosbags.typesys import get_types_from_msg
from std_msgs.msg import String
from support.graph import go, offline
from support.limits import LIMIT
from support.paths import ROOT
from support.synthetic_bag import make_walk, messages_of_walk, write_messages

from sim_node.ros.topics import stream_qos
from snca_ros.recording.bag import read_bag

VOXELS = ('voxel_0_0', 'voxel_0_1', 'voxel_1_1')


@pytest.fixture
def play(tmp_path):
    """Return a function that plays an old bag of the robot's voxels, again and again."""
    children = []

    def run():
        rows = np.zeros((60, len(VOXELS), 1, 16), np.uint8)
        steps = messages_of_walk(make_walk(voxels=VOXELS, spikes=rows), 'robot')
        of_voxels = [[m for m in step if '/voxel_' in m[0]] for step in steps]
        bag = write_messages(tmp_path / 'old', of_voxels)
        player = Path(__file__).with_name('player.py')
        children.append(subprocess.Popen(
            [sys.executable, player, bag], env={**os.environ, 'PYTHONPATH': str(ROOT)},
        ))
        return children[-1]

    yield run
    for child in children:
        assert child.poll() is None, 'the player itself has ended'
        child.kill()
        child.wait()


def simulation(start, robot, name):
    return start('sim_node', '--ros-args', '-r', f'__ns:=/{robot}', '-r', f'__node:={name}',
                 '-p', 'morphology:=11-10')


def test_voxels_follow_the_simulation_that_they_have_joined(
    walk, play, start, node, spin_until, centers, health
):
    _, children, path = walk()
    spin_until(lambda: 0 in centers[0])
    spin_until(lambda: all(health[voxel][2].get('steps') for voxel in VOXELS))
    play()
    second, elsewhere = simulation(start, 'robot', 'again'), simulation(start, 'other', 'other')
    ignored = 'sensors of another simulation'
    spin_until(lambda: all(health[v][2].get(ignored, 0) > 10 for v in VOXELS))
    for voxel in VOXELS:
        level, text, _ = health[voxel]
        assert (level, ignored in text) == (b'\x01', True), text
    spin_until(lambda: '/player and /robot/sim_node publish' in health['sim_node'][1])

    output, _ = second.communicate(timeout=LIMIT)
    assert second.returncode == 1, output
    (line,) = [line for line in output.splitlines() if 'ERROR' in line]
    assert 'WARN' not in output
    for text in ("'/robot'", '/robot/sim_node', f':{children["sim_node"].pid})'):
        assert text in line

    spin_until(lambda: node.count_publishers('/other/clock') == 1)
    assert node.count_publishers('/clock') == 1
    assert elsewhere.poll() is None

    go(node, spin_until, centers)  # now beside all of them
    spin_until(lambda: 120 in centers[0])
    np.testing.assert_array_equal([centers[0][k] for k in range(121)], offline(path, 2.0))
    assert len(centers) == 1
    assert [child.poll() for child in children.values()] == [None] * len(children)


def test_a_second_walk_ends_before_anything_is_mixed(
    start, make_controller, node, spin_until, tmp_path
):
    path = make_controller('11-10')
    common = 'walk', path, '--robot', 'robot', '--duration'
    first = start(*common, 120, '--bag', 'one')
    spin_until(lambda: node.count_subscribers('/robot/odometry') == 1)
    spin_until(lambda: node.count_publishers('/robot/odometry') == 1)
    second = start(*common, 1, '--bag', 'two')
    output, _ = second.communicate(timeout=LIMIT)
    assert second.returncode == 2, output
    errors = [line for line in output.splitlines() if 'error' in line]
    assert len(errors) == 1
    assert "'robot'" in errors[0]
    assert '/robot/sim_node (' in errors[0]
    assert not (tmp_path / 'two').exists()
    assert first.poll() is None
    first.send_signal(signal.SIGINT)
    first.communicate(timeout=LIMIT)
    recording = read_bag(tmp_path / 'one')
    n = len(recording.centers)
    np.testing.assert_array_equal(recording.centers, offline(path, n / 60)[:n])
    assert all(health.n_processes == 1 for health in recording.health.values())


def test_recorder_records_or_names_topics_of_any_type(
    start, ros, node, spin_until, health, tmp_path
):
    broken = tmp_path / 'path' / 'actionlib_msgs'
    broken.mkdir(parents=True)
    (broken / '__init__.py').write_text('raise RuntimeError("broken")')
    recorder = start(
        'recorder_node', '--ros-args', '-r', '__ns:=/robot', '-p', 'bag:=bag',
        path=[broken.parent],
    )
    strange = QoSProfile(
        depth=1, reliability=ReliabilityPolicy.BEST_EFFORT, lifespan=Duration(seconds=5),
        deadline=Duration(seconds=7),
    )
    goals = node.create_publisher(Goals, '/robot/goals', 10)
    others = [
        node.create_publisher(GoalID, '/robot/broken', 10),  # not installed for the recorder
        node.create_publisher(String, '/robot/extra/markers', strange),  # not of the kind's type
        node.create_publisher(String, '/robot/extra/text', strange),
        node.create_publisher(String, '/robot/_hidden', 10),
        node.create_publisher(Odometry, '/robot/odometry', stream_qos()),
    ]
    player = ros.create_node('player')
    double = player.create_publisher(Odometry, '/robot/odometry', stream_qos())
    spin_until(goals.get_subscription_count)
    spin_until(lambda: '/robot/broken (actionlib_msgs/msg/GoalID)' in health['recorder_node'][1])
    spin_until(lambda: '/player and /test_observer publish /robot/odometry'
               in health['recorder_node'][1])
    goals.publish(Goals())
    spin_until(lambda: recorder.poll() is None and health['recorder_node'][2]['messages'] > 0)
    recorder.send_signal(signal.SIGINT)
    output, _ = recorder.communicate(timeout=LIMIT)
    player.destroy_node()
    assert recorder.returncode == 0, output
    assert 'Traceback' not in output
    with Reader(tmp_path / 'bag') as reader:
        found = {c.topic: c for c in reader.connections}
    assert found['/robot/goals'].msgcount == 1
    assert found['/robot/goals'].digest == str(
        node.get_publishers_info_by_topic('/robot/goals')[0].topic_type_hash
    )
    types = get_types_from_msg(found['/robot/goals'].msgdef.data, 'nav_msgs/msg/Goals')
    assert types.keys() >= {'nav_msgs/msg/Goals', 'geometry_msgs/msg/PoseStamped'}
    assert '/robot/extra/text' in found
    assert not {'/robot/_hidden', '/robot/broken'} & set(found)
    assert len(others) == 5
    assert double
