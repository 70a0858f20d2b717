"""Lock-step: the simulation waits for voxels, serves reset, pause, step, names silent voxels."""

import signal

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
from support.graph import call, go, offline
from support.limits import LIMIT

from sim_node.control_time import stamp_of_step
from sim_node.ros.topics import stream_qos


def test_reset_repeats_the_episode(walk, node, spin_until, centers):
    _, _, path = walk()
    go(node, spin_until, centers)
    spin_until(lambda: 60 in centers[0])
    assert call(node, spin_until, Trigger, 'reset').success
    spin_until(lambda: len(centers) == 2 and 60 in centers[1])
    expected = offline(path, 1.0)
    for episode in centers:
        np.testing.assert_array_equal([episode[k] for k in range(61)], expected)


def test_pause_and_step(walk, node, spin_until, centers):
    _, _, path = walk()
    refused = call(node, spin_until, Trigger, 'step')
    assert refused.success
    spin_until(lambda: 1 in centers[0])
    for _ in range(4):
        newest = max(centers[0])
        call(node, spin_until, Trigger, 'step')
        spin_until(lambda newest=newest: max(centers[0]) == newest + 1)
    assert max(centers[0]) == 5
    assert call(node, spin_until, SetBool, 'pause', data=False).success
    spin_until(lambda: 60 in centers[0])
    assert not call(node, spin_until, Trigger, 'step').success
    np.testing.assert_array_equal([centers[0][k] for k in range(61)], offline(path, 1.0))


def test_late_voxel_joins_and_nothing_differs(walk, start_node, node, spin_until, centers):
    graph, children, path = walk(duration=1.0, leave_out=('voxel_0_1',))
    spin_until(lambda: node.count_publishers('/robot/voxel_0_0/actuation') == 1)
    go(node, spin_until, centers)
    assert max(centers[0]) == 0
    start_node(graph, graph.voxels[1])
    spin_until(lambda: 60 in centers[0])
    np.testing.assert_array_equal([centers[0][k] for k in range(61)], offline(path, 1.0))
    assert children['sim_node'].wait(LIMIT) == 0


def test_silent_voxel_is_named_and_the_run_stops(walk, node, spin_until, centers):
    _, children, _ = walk(silence_limit=1.0)
    go(node, spin_until, centers)
    spin_until(lambda: 30 in centers[0])
    children['voxel_0_1'].send_signal(signal.SIGKILL)
    output, _ = children['sim_node'].communicate(timeout=LIMIT)
    assert children['sim_node'].returncode == 1
    assert 'voxel_0_1' in output
    assert 'within 1 s' in output


def test_run_continues_without_a_silent_voxel(walk, node, spin_until, centers):
    levels = {}

    def note(message):
        levels.update({status.name: status for status in message.status})

    node.create_subscription(DiagnosticArray, '/diagnostics', note, 10)
    _, children, _ = walk(silence_limit=2.0, on_silence='go_on')
    go(node, spin_until, centers)
    spin_until(lambda: 30 in centers[0])
    children['voxel_1_1'].send_signal(signal.SIGKILL)
    newest = max(centers[0])
    spin_until(lambda: max(centers[0]) > newest + 100)
    spin_until(lambda: 'voxel_1_1' in levels['/robot/sim_node'].message)
    assert children['sim_node'].poll() is None


def test_killed_voxels_are_named_and_rejoin_when_started_again(
    walk, start_node, node, spin_until, centers, health
):
    graph, children, _ = walk(silence_limit=60.0)
    go(node, spin_until, centers)
    for i, process in enumerate(graph.voxels):
        (name,) = process.names
        reached = 300 * (i + 1)
        spin_until(lambda reached=reached: max(centers[0]) > reached)
        children[name].send_signal(signal.SIGKILL)
        children[name].wait(LIMIT)
        spin_until(lambda name=name: health['sim_node'][1].endswith(f'waits for {name}'))
        children[name] = start_node(graph, process)
        newest = max(centers[0])
        spin_until(lambda newest=newest: max(centers[0]) > newest + 50)


def test_run_stops_when_all_voxels_are_silent(walk, node, spin_until, centers):
    """Without patience the neighbours of a dead voxel become silent too, until all are."""
    _, children, _ = walk(silence_limit=1.0, on_silence='go_on', patience=0.0)
    go(node, spin_until, centers)
    spin_until(lambda: max(centers[0]) > 30)
    children['voxel_0_1'].send_signal(signal.SIGKILL)
    output, _ = children['sim_node'].communicate(timeout=LIMIT)
    assert children['sim_node'].returncode == 1
    assert 'every voxel is silent' in output


def test_services_answer_while_the_recorder_is_awaited(walk, node, spin_until):
    _, children, _ = walk(recorders=1)
    assert call(node, spin_until, SetBool, 'pause', data=False).success
    for name in ('reset', 'step'):
        assert not call(node, spin_until, Trigger, name).success
    assert children['sim_node'].poll() is None


def test_use_sim_time_changes_nothing(walk, node, spin_until, centers):
    _, _, path = walk(use_sim_time=True)
    go(node, spin_until, centers)
    spin_until(lambda: 60 in centers[0])
    np.testing.assert_array_equal([centers[0][k] for k in range(61)], offline(path, 1.0))


def test_refused_messages_change_nothing(walk, node, spin_until, centers):
    """Wrong length, NaN, a stamp from the future, wrong names: counted, and no step differs."""
    _, _, path = walk()
    publisher = node.create_publisher(JointState, '/robot/voxel_0_0/actuation', stream_qos())
    spin_until(lambda: publisher.get_subscription_count() >= 1)

    def actuation(step, names, values):
        message = JointState(name=names, position=values)
        message.header.frame_id = 'voxel_0_0'
        message.header.stamp.sec, message.header.stamp.nanosec = stamp_of_step(step)
        return message

    bad = [
        actuation(0, ['voxel_0_0'], [float('nan')]),
        actuation(0, ['voxel_0_0'], [2.0]),
        actuation(0, ['voxel_0_0'], [0.5, 0.5]),
        actuation(0, ['voxel_0_0'], []),
        actuation(0, ['someone'], [0.5]),
        actuation(10_000, ['voxel_0_0'], [0.5]),
    ]
    bad.append(actuation(0, ['voxel_0_0'], [0.5]))
    bad[-1].header.stamp.nanosec = 7
    counted = {}

    def note(message):
        for status in message.status:
            counted[status.name] = {v.key: v.value for v in status.values}

    node.create_subscription(DiagnosticArray, '/diagnostics', note, 10)
    for message in bad:
        publisher.publish(message)
    spin_until(
        lambda: counted.get('/robot/sim_node', {}).get('refused messages') == str(len(bad))
    )
    assert call(node, spin_until, SetBool, 'pause', data=False).success
    spin_until(lambda: 60 in centers[0])
    np.testing.assert_array_equal([centers[0][k] for k in range(61)], offline(path, 1.0))
