"""Nodes as forks of one process: their environment, exit codes, signals and end."""

import os
import signal

import pytest
from support.limits import LIMIT
from support.processes import is_alive, name_of, wait_until

from snca_ros.graph.fork_server import ForkServer

RUN = ['sim_node', '--ros-args', '-r', '__ns:=/forked']


@pytest.fixture(scope='module')
def server():
    server = ForkServer(dict(os.environ))
    yield server
    server.close()


def start(server, *arguments, **environment):
    return server.start(list(arguments), {**os.environ, **environment}, 'forked')


def test_a_node_has_its_session_and_name_and_ends_by_signals(server):
    nodes = [start(server, *RUN) for _ in range(2)]
    for node in nodes:
        wait_until(lambda node=node: name_of(node.pid) == 'forked')
        assert os.getsid(node.pid) == node.pid
        assert os.readlink(f'/proc/{node.pid}/fd/0') == os.devnull
        assert node.poll() is None
    nodes[0].kill()
    nodes[1].send_signal(signal.SIGTERM)
    assert [node.wait(LIMIT) for node in nodes] == [-signal.SIGKILL, 0]
    nodes[0].kill()  # which does not reach another process


def test_no_early_signal_is_lost(server):
    for _ in range(20):
        node = start(server, *RUN)
        node.send_signal(signal.SIGINT)
        assert node.wait(LIMIT) == 0


def test_exit_codes_and_the_end_of_the_server(capfd):
    server = ForkServer(dict(os.environ))
    helped, refused = start(server, 'sim_node', '--help'), start(server, 'sim_node', 'walk')
    elsewhere = start(server, *RUN, ROS_DOMAIN_ID='nowhere')
    assert [process.wait(LIMIT) for process in (helped, refused, elsewhere)] == [0, 2, 2]
    output, error = capfd.readouterr()
    assert 'usage: ' in output
    assert "got 'walk'" in error
    assert 'ROS_DOMAIN_ID' in error

    node = start(server, *RUN)
    wait_until(lambda: name_of(node.pid) == 'forked')
    os.kill(server.pid, signal.SIGKILL)
    wait_until(lambda: not is_alive(node.pid))
    assert node.wait() == -signal.SIGTERM
    with pytest.raises(OSError, match=r'ended|Broken pipe'):
        start(server, *RUN)
    server.close()
