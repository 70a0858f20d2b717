"""Best-effort links in real time: episodes begin, voxels join, and everything is recorded."""

import signal
from types import SimpleNamespace

import numpy as np
from rclpy.qos import DurabilityPolicy, ReliabilityPolicy
from std_srvs.srv import SetBool, Trigger
from support.graph import call, go, offline
from support.limits import LIMIT

from sim_node.control_time import START_STEPS
from sim_node.ros.sim_interface import BEST_EFFORT, RELIABLE
from sim_node.ros.topics import actuation_format, read_joint_state
from snca_ros.cell.architecture import Architecture
from snca_ros.nodes.cell_messages import CellMessages
from snca_ros.nodes.voxel_publishers import VoxelPublishers
from snca_ros.recording.bag import read_bag

LINKS = ('sensors', 'actuation', 'spikes')


def test_only_links_are_best_effort(walk, node, spin_until, centers):
    walk(real_time_factor=1.0, reliability=BEST_EFFORT)
    go(node, spin_until, centers)
    spin_until(lambda: 10 in centers[0])
    for topic in (*(f'voxel_0_0/{kind}' for kind in LINKS), 'odometry', 'applied_actuation'):
        of_link = topic.startswith('voxel')
        ends = [
            end for list_ends in (node.get_publishers_info_by_topic,
                                  node.get_subscriptions_info_by_topic)
            for end in list_ends(f'/robot/{topic}') if end.node_namespace == '/robot'
        ]
        assert len(ends) >= (2 if of_link else 1)
        for end in ends:
            qos = end.qos_profile
            is_best_effort = qos.reliability == ReliabilityPolicy.BEST_EFFORT
            is_volatile = qos.durability == DurabilityPolicy.VOLATILE
            assert (is_best_effort, is_volatile) == (of_link, of_link), topic


def test_voxels_that_start_after_step_0_was_published_begin_the_episode(
    walk, start_node, node, spin_until, centers, health
):
    """Best-effort publishers keep nothing for them: the simulation repeats the sensors."""
    names = 'voxel_0_0', 'voxel_0_1', 'voxel_1_1'
    graph, _, path = walk(real_time_factor=1.0, reliability=BEST_EFFORT, leave_out=names)
    go(node, spin_until, centers)
    spin_until(lambda: 'waits for' in health['sim_node'][1])
    for process in graph.voxels:
        start_node(graph, process)
    spin_until(lambda: 30 in centers[0])
    np.testing.assert_array_equal([centers[0][k] for k in range(3)], offline(path, 2 / 60))
    assert health['sim_node'][2]['best-effort links'] == 3


def test_a_killed_voxel_joins_again_and_a_reset_begins_an_episode(
    walk, start_node, node, spin_until, centers, health
):
    graph, children, _ = walk(real_time_factor=1.0, reliability=BEST_EFFORT)
    go(node, spin_until, centers)
    spin_until(lambda: 30 in centers[0])
    children['voxel_0_1'].send_signal(signal.SIGKILL)
    spin_until(lambda: 'silent: voxel_0_1' in health['sim_node'][1])
    start_node(graph, graph.voxels[1])
    spin_until(lambda: 'voxel_0_1' not in health['sim_node'][1])
    spin_until(lambda: health['voxel_0_1'][2].get('steps', 0) > 30)
    spin_until(lambda: 'silent' not in health['voxel_0_0'][1])
    assert call(node, spin_until, Trigger, 'reset').success
    spin_until(lambda: len(centers) == 2)
    assert call(node, spin_until, SetBool, 'pause', data=False).success
    spin_until(lambda: 60 in centers[1])


def test_a_walk_on_one_machine_loses_nothing(start, make_controller, tmp_path):
    """Only as much as the processes are late: on a busy machine some messages are."""
    child = start(
        'walk', make_controller('11-10'), '--real-time-factor', '0.5', '--reliability',
        'best_effort', '--duration', 1, '--bag', 'bag',
    )
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0, output
    bag = read_bag(tmp_path / 'bag')
    assert bag.n_steps == 61
    (on_time, late, lost), *_ = bag.health['sim_node'].deliveries.values()
    assert on_time + late + lost == 60
    for count in bag.counts:
        if count.kind in LINKS:
            assert count.sent + len(count.unsent) == 60


def test_messages_of_the_first_steps_are_repeated_over_best_effort_links():
    architecture = Architecture.named('U-D', 'mlp', n_c=2)
    own, wire = CellMessages(architecture, 'voxel_0_0'), actuation_format('voxel_0_0')
    sent = []

    def create_publisher(kind, topic, qos):
        assert topic in ('voxel_0_0/values', 'voxel_0_0/actuation')
        return SimpleNamespace(publish=lambda data: sent.append((topic.partition('/')[2], data)))

    def published():
        """Return kind, episode, step and mean of what was published since the last call."""
        found = []
        for kind, data in sent:
            decoded = own.decode(data) if kind == 'values' else read_joint_state(wire, data, -1, 1)
            found.append((kind, *decoded[:2], float(decoded[2].mean())))
        sent.clear()
        return found

    def answer(outputs, episode, step):
        outputs.publish_message(episode, step, np.full(own.shape, 0.5))
        outputs.publish_actuation(episode, step, -0.25)
        return [('values', episode, step, 0.5), ('actuation', episode, step, -0.25)]

    old, new = b'r0123456', b'r0123457'
    for reliability in (BEST_EFFORT, RELIABLE):
        outputs = VoxelPublishers(
            SimpleNamespace(create_publisher=create_publisher), 'voxel_0_0', architecture,
            reliability,
        )
        repeats = reliability == BEST_EFFORT
        for episode in (old, new):
            outputs.repeat(episode, 0)
            assert published() == []
            outputs.publish_silence(episode, 0)
            kept = [('values', episode, 0, 0.0), *answer(outputs, episode, START_STEPS - 1)]
            assert published() == kept
            outputs.repeat(episode, START_STEPS - 1)
            assert published() == (kept if repeats else [])
            more = answer(outputs, episode, START_STEPS)
            assert published() == more
            outputs.repeat(episode, START_STEPS)
            assert published() == []
        assert outputs.keeps(START_STEPS - 1) == repeats
        assert not outputs.keeps(START_STEPS)
