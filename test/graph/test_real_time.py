"""Real time: the simulation keeps its rate without waiting, and counts every message."""

import signal

import numpy as np
from sensor_msgs.msg import JointState
from std_srvs.srv import SetBool, Trigger
from support.graph import call, go, offline
from support.limits import LIMIT

from sim_node.ros.topics import stream_qos


def links_of(figures):
    """Return {topic: messages on time, late and lost} from a node's diagnostics."""
    found = {}
    for key, count in figures.items():
        for outcome in ('on time', 'late', 'lost'):
            if key.endswith(f' {outcome}'):
                found.setdefault(key.removesuffix(f' {outcome}'), {})[outcome] = count
    return found


def silent(health):
    """Return what the simulation says of silent voxels; on a busy machine living ones may be."""
    return health['sim_node'][1] if 'silent' in health['sim_node'][1] else ''


def test_every_message_is_accounted_for(walk, node, spin_until, centers, health):
    _, children, path = walk(real_time_factor=2.0, duration=5.0)
    go(node, spin_until, centers)
    output, _ = children['sim_node'].communicate(timeout=LIMIT)
    assert children['sim_node'].returncode == 0, output
    spin_until(lambda: health['sim_node'][2].get('steps') == 300)
    figures = health['sim_node'][2]
    assert figures['step time p50 [ms]'] <= figures['step time p99 [ms]']
    assert figures['step time p99 [ms]'] <= figures['step time max [ms]']
    links = links_of(figures)
    assert sorted(links) == [f'voxel_{v}/actuation' for v in ('0_0', '0_1', '1_1')]
    assert [sum(link.values()) for link in links.values()] == [300] * 3
    spin_until(lambda: health['voxel_0_1'][2].get('steps', 0) >= 295)
    links = links_of(health['voxel_0_1'][2])
    assert sorted(links) == ['voxel_0_0/spikes', 'voxel_0_1/sensors', 'voxel_1_1/spikes']
    # The start is in lock-step: at least this far the walk is that of the offline twin.
    np.testing.assert_array_equal([centers[0][k] for k in range(3)], offline(path, 2 / 60))


def test_dead_voxel_is_named_and_the_walk_continues(
    walk, start_node, node, spin_until, centers, health
):
    graph, children, _ = walk(real_time_factor=1.0)
    applied = {}
    node.create_subscription(
        JointState, '/robot/applied_actuation',
        lambda m: applied.update({m.name[1]: (m.position[1], m.effort[1])}), stream_qos(1000),
    )
    go(node, spin_until, centers)
    spin_until(lambda: 30 in centers[0])
    assert applied['voxel_0_1'][1] >= 0
    children['voxel_0_1'].send_signal(signal.SIGKILL)
    spin_until(lambda: 'voxel_0_1' in silent(health))
    spin_until(lambda: all(
        'silent: voxel_0_1' in health[name][1] for name in ('voxel_0_0', 'voxel_1_1')
    ))
    newest = max(centers[0])
    spin_until(lambda: max(centers[0]) > newest + 60)
    assert applied['voxel_0_1'] == (0.0, -1.0)
    assert children['sim_node'].poll() is None
    before = links_of(health['sim_node'][2])
    assert before['voxel_0_1/actuation']['lost'] > 30

    start_node(graph, graph.voxels[1])
    spin_until(lambda: 'voxel_0_1' not in silent(health))
    spin_until(lambda: 'silent: voxel_0_1' not in health['voxel_0_0'][1])
    spin_until(lambda: health['voxel_0_1'][2].get('steps', 0) > 30)
    spin_until(lambda: applied['voxel_0_1'][1] == 0.0)


def test_restarted_simulation_in_mid_run(walk, start_node, node, spin_until, centers, health):
    """Voxels reset whatever step they receive first, and the new walk begins at step 0."""
    graph, children, path = walk(real_time_factor=1.0)
    go(node, spin_until, centers)
    spin_until(lambda: 60 in centers[0])
    children['sim_node'].send_signal(signal.SIGKILL)
    children['sim_node'].wait(LIMIT)
    start_node(graph, graph.simulation)
    spin_until(lambda: len(centers) == 2)
    assert call(node, spin_until, SetBool, 'pause', data=False).success
    spin_until(lambda: 60 in centers[1])
    np.testing.assert_array_equal([centers[1][k] for k in range(3)], offline(path, 2 / 60))


def test_pause_step_and_reset(walk, node, spin_until, centers, health):
    walk(real_time_factor=1.0)
    go(node, spin_until, centers)
    spin_until(lambda: 30 in centers[0])
    assert call(node, spin_until, SetBool, 'pause', data=True).success
    spin_until(lambda: health['sim_node'][1].startswith('paused'))
    reached = max(centers[0])
    for k in (1, 2):
        assert call(node, spin_until, Trigger, 'step').success
        spin_until(lambda k=k: reached + k in centers[0])
    assert max(centers[0]) == reached + 2
    assert call(node, spin_until, Trigger, 'reset').success
    spin_until(lambda: len(centers) == 2)
    assert call(node, spin_until, SetBool, 'pause', data=False).success
    spin_until(lambda: 60 in centers[1])
