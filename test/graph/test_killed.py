"""Processes are killed by kill -9: the others continue, and a restarted one takes part again."""

import signal

import numpy as np
from std_srvs.srv import Trigger
from support.graph import call, go, offline
from support.limits import LIMIT


def test_restarted_simulation_is_a_new_episode(walk, start_node, node, spin_until, centers, health):
    """Running voxels reset their cells; messages of the old episode are not used."""
    graph, children, path = walk()
    for k in range(4):
        spin_until(lambda k=k: k in centers[0])
        assert call(node, spin_until, Trigger, 'step').success
    spin_until(lambda: 4 in centers[0])
    children['sim_node'].send_signal(signal.SIGKILL)
    children['sim_node'].wait(LIMIT)
    start_node(graph, graph.simulation)
    spin_until(lambda: len(centers) == 2)
    spin_until(lambda: health['sim_node'][2].get('actuation of another episode', 0) >= 12)
    go(node, spin_until, centers)
    spin_until(lambda: 60 in centers[1])
    np.testing.assert_array_equal([centers[1][k] for k in range(61)], offline(path, 1.0))
