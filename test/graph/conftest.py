"""Graph tests start real processes over real DDS, in a ROS domain of their own.

Nodes are forks of servers that have imported everything; `start(..., real=True)` is without.
"""

import os
import subprocess
import sys
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from support.domains import claim_domain
from support.forks import Fork, Forks
from support.limits import LIMIT, be_patient
from support.paths import ROOT
from support.warm import warm

from snca_ros.graph.environment import graph_environment

_domain, _claim = claim_domain()  # before rclpy is imported
os.environ['ROS_DOMAIN_ID'] = str(_domain)
os.environ.update(graph_environment())  # loopback alone

rclpy = pytest.importorskip('rclpy')

from diagnostic_msgs.msg import DiagnosticArray  # noqa: E402
from nav_msgs.msg import Odometry  # noqa: E402

from sim_node.control_time import step_of_stamp  # noqa: E402
from sim_node.model.morphology import parse_morphology  # noqa: E402
from sim_node.model.sensors import DEFAULT_SENSORS  # noqa: E402
from sim_node.ros.sim_interface import RELIABLE  # noqa: E402
from sim_node.ros.topics import stream_qos  # noqa: E402
from snca_ros.cell.architecture import Architecture  # noqa: E402
from snca_ros.controller_file import (  # noqa: E402
    TrainedController,
    load_controller,
    save_controller,
)
from snca_ros.files import write_text  # noqa: E402
from snca_ros.graph import processes  # noqa: E402
from snca_ros.graph.child_process import PARENT  # noqa: E402
from snca_ros.graph.fork_server import ForkServer  # noqa: E402

be_patient()  # before tests import what it changes

from snca_ros.graph.description import Graph, WalkOptions, describe_graph  # noqa: E402


def pytest_collection_modifyitems(items):
    """Mark all tests of this folder; the hook is given those of others, too."""
    for item in items:
        if item.path.is_relative_to(Path(__file__).parent):
            item.add_marker('graph')


@pytest.fixture(scope='session', autouse=True)
def compiled():
    """Compile the functions that nodes use, so that no test waits for compilation."""
    warm()


@pytest.fixture(scope='session')
def forks():
    """Return the server of the processes that `start` starts."""
    forks = Forks()
    yield forks
    forks.close()


@pytest.fixture(scope='session', autouse=True)
def shared_server():
    """Let all `RunningGraph`s of the tests use one fork server."""
    servers = []

    class Shared:
        def __init__(self, environment: dict[str, str]) -> None:
            if not servers:
                servers.append(ForkServer(environment))

        def __getattr__(self, name: str) -> object:
            return getattr(servers[0], name)

        def close(self) -> None:
            """Leave the server to the next graph."""

    processes.ForkServer = Shared
    yield
    for server in servers:
        server.close()


@pytest.fixture(scope='session')
def ros():
    """Keep rclpy initialised in the test process."""
    rclpy.init(args=[])
    yield rclpy
    rclpy.try_shutdown()


@pytest.fixture
def node(ros):
    """Return a node of the test's own."""
    node = ros.create_node('test_observer')
    yield node
    node.destroy_node()


@pytest.fixture
def spin_until(node) -> Callable[[Callable[[], object]], None]:
    """Return a function that spins the test's node until a condition holds."""

    def spin(condition: Callable[[], object]) -> None:
        deadline = time.monotonic() + LIMIT
        while not condition():
            assert time.monotonic() < deadline, 'the condition never came true'
            rclpy.spin_once(node, timeout_sec=0.05)

    return spin


@pytest.fixture
def make_controller(tmp_path):
    """Return a function that writes a controller file with random parameters."""

    def make(
        shape: str = '11-10', name: str = 'U-nD', model: str = 'snn-h', seed: int = 0,
        sensors: tuple[str, ...] = DEFAULT_SENSORS, **options: object,
    ) -> Path:
        morphology = parse_morphology(shape)
        architecture = Architecture.named(name, model, sensors=sensors)
        rng = np.random.default_rng(seed)
        theta = rng.uniform(-1.0, 1.0, architecture.n_parameters(morphology.n_voxels))
        path = tmp_path / f'{shape}-{name}-{model}-{seed}.npz'
        save_controller(path, TrainedController(architecture, morphology, theta, **options))
        return path

    return make


@pytest.fixture
def start(tmp_path, forks):
    """Return a function that starts `[prefix] python -m snca_ros ...`; all end with the test.

    Without a prefix and further options it is a fork that need not import, unless it is to be real.
    """
    children: list[subprocess.Popen | Fork] = []

    def run(*arguments: object, real: bool = False, **options) -> subprocess.Popen | Fork:
        words = list(map(str, arguments))
        path = os.pathsep.join(map(str, [ROOT, *options.pop('path', ())]))
        environment = {**os.environ, 'PYTHONPATH': path, PARENT: str(os.getpid())}
        if not real and not options and path == str(ROOT):
            children.append(forks.start(words, environment, tmp_path))
            return children[-1]
        child = subprocess.Popen(
            [*options.pop('prefix', ()), sys.executable, '-m', 'snca_ros', *words],
            cwd=tmp_path,
            env=environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            **options,
        )
        children.append(child)
        return child

    yield run
    for child in children:
        if child.poll() is None:
            child.kill()
        child.communicate(timeout=LIMIT)


@pytest.fixture
def attack():
    """Return a function that starts an attacker on a robot."""
    children = []

    def run(robot):
        attacker = Path(__file__).with_name('attacker.py')
        children.append(subprocess.Popen(
            [sys.executable, attacker, robot], env={**os.environ, 'PYTHONPATH': str(ROOT)},
        ))
        return children[-1]

    yield run
    for child in children:
        assert child.poll() is None, 'the attacker itself has ended'
        child.kill()
        child.wait()


@pytest.fixture
def start_node(start, tmp_path):
    """Return a function that starts one process of a described graph."""

    def run(graph: Graph, process) -> subprocess.Popen:
        params = tmp_path / 'params.yaml'
        write_text(params, graph.parameters_yaml())  # whole: other processes may be reading it
        return start(
            process.executable, *process.names,
            '--ros-args', '-r', f'__ns:=/{graph.robot}', '--params-file', params,
        )

    return run


@pytest.fixture
def walk(start_node, make_controller):
    """Return a function that starts a robot of three voxels; (graph, children by name)."""

    def run(
        duration=0.0, real_time_factor=0.0, leave_out=(), patience=None, reliability=RELIABLE,
        **simulation,
    ):
        # Paused until the test listens: the graph is faster than a test that looks at it.
        simulation = {'start_paused': True, **simulation}
        path = make_controller('11-10')
        options = WalkOptions(
            robot='robot', duration=duration, real_time_factor=real_time_factor,
            reliability=reliability, simulation=simulation,
        )
        graph = describe_graph(path, load_controller(path), options)
        children = {'sim_node': start_node(graph, graph.simulation)}
        for process in graph.voxels:
            if patience is not None:
                process.parameters[process.names[0]]['patience'] = patience
            if process.names[0] not in leave_out:
                children[process.names[0]] = start_node(graph, process)
        return graph, children, path

    return run


@pytest.fixture
def centers(node):
    """Collect the robot's centre by control step, from odometry; a reset starts a new dict."""
    episodes = [{}]

    def note(message):
        step = step_of_stamp(message.header.stamp.sec, message.header.stamp.nanosec)
        if step == 0 and episodes[-1]:
            episodes.append({})
        position = message.pose.pose.position
        episodes[-1][step] = (position.x, position.z)

    node.create_subscription(Odometry, '/robot/odometry', note, stream_qos(1000))
    return episodes


@pytest.fixture
def health(node):
    """Collect the last diagnostics of each node: (level, text, values by key) by short name."""
    found = defaultdict(lambda: (b'', '', {}))

    def note(message):
        for status in message.status:
            values = {v.key: float(v.value) for v in status.values}
            found[status.name.rpartition('/')[2]] = status.level, status.message, values

    node.create_subscription(DiagnosticArray, '/diagnostics', note, 100)
    return found
