"""Processes are killed or stopped: the others continue, and take part again."""

import shutil
import signal
import subprocess
from pathlib import Path

import numpy as np
import pytest
from diagnostic_msgs.msg import DiagnosticArray
from std_srvs.srv import Trigger
from support.graph import call, go, offline
from support.limits import LIMIT
from support.processes import TICK, stat_of, wait_until

from snca_ros.controller_file import load_controller
from snca_ros.graph.description import WalkOptions, describe_graph
from snca_ros.graph.processes import RunningGraph
from snca_ros.recording.bag import read_bag

SENDS = 5  # of a voxel in a step: its message to two neighbours and recorder, its actuation to two


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
    simulation.send_signal(signal.SIGTERM)
    output, _ = simulation.communicate(timeout=LIMIT)
    assert simulation.returncode == 0
    assert 'no actuation' not in output
    assert 'limp' not in output


@pytest.fixture
def kill_at_send():
    """Return a function that has strace kill a process when its main thread sends for the nth time.

    The main thread publishes; other threads of Fast DDS send what readers ask for again.
    """
    if shutil.which('strace') is None:
        pytest.skip('no strace; Debian, Ubuntu: apt install strace')
    tracers = []

    def attach(pid: int, n: int) -> None:
        inject = f'inject=sendto,sendmsg:signal=KILL:when={n}'
        tracers.append(subprocess.Popen(
            ['strace', '-qq', '-e', 'trace=sendto,sendmsg', '-e', inject, '-p', str(pid)],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True,
        ))
        status = Path(f'/proc/{pid}/status')
        wait_until(lambda: 'TracerPid:\t0\n' not in status.read_text()
                   or tracers[-1].poll() is not None)
        if tracers[-1].poll() is not None and 'not permitted' in tracers[-1].stderr.read():
            pytest.skip('strace may not attach to processes')

    yield attach
    for tracer in tracers:
        tracer.kill()
        tracer.communicate()


def test_a_kill_at_each_send_is_accounted_for(
    make_controller, kill_at_send, node, spin_until, centers, tmp_path
):
    path, bag = make_controller('11-10'), tmp_path / 'bag'
    options = WalkOptions(robot='robot', duration=0.0, bag=str(bag),
                          simulation={'start_paused': True})
    graph = describe_graph(path, load_controller(path), options)

    heard = []  # processes of the diagnostics of the voxels

    def note(message):
        heard.extend(status.hardware_id.rpartition(':')[2] for status in message.status)

    node.create_subscription(DiagnosticArray, '/diagnostics', note, 100)

    def step():
        assert call(node, spin_until, Trigger, 'step').success

    with RunningGraph(graph, {}) as running:
        spin_until(lambda: 0 in centers[0])
        victim = graph.voxels[1]
        assert victim.names == ('voxel_0_1',)
        for n in range(1, SENDS + 1):
            begin = max(centers[0])
            step()
            spin_until(lambda begin=begin: max(centers[0]) > begin)
            pid = str(running.pids()[victim])  # of which the bag knows, too, after two messages
            spin_until(lambda pid=pid: heard.count(pid) > 1)
            kill_at_send(running.pids()[victim], n)
            while running.exit_code(victim) is None:
                step()
            assert running.exit_code(victim) == -signal.SIGKILL
            stopped = max(centers[0])
            running.start_again(victim)
            step()
            step()
            spin_until(lambda stopped=stopped: max(centers[0]) > stopped + 1)
    recording = read_bag(bag)
    assert recording.health['voxel_0_1'].n_processes == SENDS + 1
    counts = [count for count in recording.counts if count.missing is not None]
    assert sum(len(count.killed) for count in counts) <= SENDS
    for count in counts:
        explained = f'{count.topic}: {recording.outcomes[:, 1]}, late {count.late}'
        assert count.missing.tolist() == count.killed.tolist(), explained
