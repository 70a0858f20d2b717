"""Graph tests start real processes over real DDS, in a ROS domain of their own."""

import os
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from snca_ros.box import graph_environment

# Before rclpy is imported: domains 1 to 100 are free of the kernel's ephemeral ports.
os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % 100)
os.environ.update(graph_environment())  # loopback alone

rclpy = pytest.importorskip('rclpy')

from sim_node.morphology import parse_morphology  # noqa: E402
from snca_ros.cell.nca import Architecture  # noqa: E402
from snca_ros.controller_file import TrainedController, save_controller  # noqa: E402
from snca_ros.nodes.bringup import Graph  # noqa: E402
from snca_ros.nodes.lifeline import PARENT  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
DEADLINE = 60.0


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

    def spin(condition: Callable[[], object], seconds: float = DEADLINE) -> None:
        deadline = time.monotonic() + seconds
        while not condition():
            assert time.monotonic() < deadline, 'the condition never came true'
            rclpy.spin_once(node, timeout_sec=0.05)

    return spin


@pytest.fixture
def make_controller(tmp_path):
    """Return a function that writes a controller file with random parameters."""

    def make(shape: str = '11-10', name: str = 'U-nD', model: str = 'snn-h', seed: int = 0) -> Path:
        morphology, architecture = parse_morphology(shape), Architecture.named(name, model)
        rng = np.random.default_rng(seed)
        theta = rng.uniform(-1.0, 1.0, architecture.n_parameters(morphology.n_voxels))
        path = tmp_path / f'{shape}-{name}-{model}-{seed}.npz'
        save_controller(path, TrainedController(architecture, morphology, theta))
        return path

    return make


@pytest.fixture
def start(tmp_path):
    """Return a function that starts `python -m snca_ros ...`; all end with the test."""
    children: list[subprocess.Popen] = []

    def run(*arguments: object, **options) -> subprocess.Popen:
        child = subprocess.Popen(
            [sys.executable, '-m', 'snca_ros', *map(str, arguments)],
            cwd=options.pop('cwd', tmp_path),
            env={**os.environ, 'PYTHONPATH': str(ROOT), PARENT: str(os.getpid())},
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
        child.communicate()


@pytest.fixture
def start_node(start, tmp_path):
    """Return a function that starts one process of a described graph."""

    def run(graph: Graph, process) -> subprocess.Popen:
        params = tmp_path / 'params.yaml'
        params.write_text(graph.parameters_yaml())
        return start(
            process.executable, *process.names,
            '--ros-args', '-r', f'__ns:=/{graph.robot}', '--params-file', params,
        )

    return run


def children_of(pid: int) -> list[int]:
    """Return the pids of the living children of a process."""
    found = []
    for stat in Path('/proc').glob('[0-9]*/stat'):
        try:
            fields = stat.read_text().rpartition(')')[2].split()
        except OSError:
            continue
        if int(fields[1]) == pid and fields[0] != 'Z':
            found.append(int(stat.parent.name))
    return found


def is_alive(pid: int) -> bool:
    """Tell whether a process runs; a zombie does not."""
    try:
        return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0] != 'Z'
    except OSError:
        return False
