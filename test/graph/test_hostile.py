"""A robot under attack: invalid messages are refused and counted, and no step differs."""

import signal

import numpy as np
from support.graph import go, offline
from support.limits import LIMIT


def refused(health):
    return {name: values.get('refused messages', 0) for name, (_, _, values) in health.items()}


def test_no_step_differs_under_attack(walk, attack, node, spin_until, centers, health):
    _, children, path = walk()
    attack('/robot')
    spin_until(lambda: sum(count > 50 for count in refused(health).values()) == len(children))
    go(node, spin_until, centers)
    spin_until(lambda: 300 in centers[0])
    np.testing.assert_array_equal([centers[0][k] for k in range(301)], offline(path, 5.0))
    assert [child.poll() for child in children.values()] == [None] * len(children)
    assert len(centers) == 1


def test_a_duplicate_of_a_voxel_is_held_back(
    walk, start_node, node, spin_until, centers, health
):
    graph, children, path = walk()
    spin_until(lambda: node.count_publishers('/robot/voxel_0_0/actuation') == 1)
    spin_until(lambda: 0 in centers[0])
    double = start_node(graph, graph.voxels[0])
    spin_until(lambda: 'held back' in health['voxel_0_0'][1])
    go(node, spin_until, centers)
    spin_until(lambda: 300 in centers[0])
    np.testing.assert_array_equal([centers[0][k] for k in range(301)], offline(path, 5.0))
    assert double.poll() is None
    children['voxel_0_0'].send_signal(signal.SIGTERM)
    children['voxel_0_0'].wait(LIMIT)
    gone = max(centers[0])
    spin_until(lambda: max(centers[0]) > gone + 100)  # now the duplicate takes its place


def test_walk_recorded_under_attack_equals_its_offline_twin(start, attack, make_controller):
    attack('/robot')
    child = start('walk', make_controller('11-10'), '--robot', 'robot', '--duration', 2,
                  '--bag', 'bag')
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0, output
    assert '121 positions of the centre, bit for bit the same' in output
    assert 'Traceback' not in output
