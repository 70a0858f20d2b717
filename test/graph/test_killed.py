"""Processes are killed or stopped: the others continue, and take part again."""

import signal

import numpy as np
import pytest
from std_srvs.srv import Trigger
from support.graph import call, go, offline
from support.processes import TICK, stat_of, wait_until


def test_restarted_simulation_is_a_new_episode(walk, start_node, node, spin_until, centers, health):
    """Running voxels reset their cells; messages of the old episode are not used."""
    graph, children, path = walk()
    for k in range(4):
        spin_until(lambda k=k: k in centers[0])
        assert call(node, spin_until, Trigger, 'step').success
    spin_until(lambda: 4 in centers[0])
    children['sim_node'].send_signal(signal.SIGKILL)
    children['sim_node'].wait(30)
    start_node(graph, graph.simulation)
    spin_until(lambda: len(centers) == 2)
    spin_until(lambda: health['sim_node'][2].get('actuation of another episode', 0) >= 12)
    go(node, spin_until, centers)
    spin_until(lambda: 60 in centers[1])
    np.testing.assert_array_equal([centers[1][k] for k in range(61)], offline(path, 1.0))


@pytest.mark.parametrize('real_time_factor', [0.0, 1.0])
def test_a_stopped_simulation_condemns_nobody(
    walk, node, spin_until, centers, real_time_factor
):
    """It finds the answers in its queue when it runs again."""
    _, children, _ = walk(real_time_factor=real_time_factor, silence_limit=0.5)
    simulation = children['sim_node']
    go(node, spin_until, centers)
    for _ in range(3):
        newest = max(centers[0])
        spin_until(lambda newest=newest: max(centers[0]) > newest + 10)
        simulation.send_signal(signal.SIGSTOP)
        wait_until(lambda: stat_of(simulation.pid)[0] == 'T')
        TICK.wait(0.6)  # beyond the limits
        simulation.send_signal(signal.SIGCONT)
    newest = max(centers[0])
    spin_until(lambda: max(centers[0]) > newest + 10)
    simulation.terminate()
    output, _ = simulation.communicate(timeout=60)
    assert simulation.returncode == 0
    assert 'no actuation' not in output
    assert 'limp' not in output
