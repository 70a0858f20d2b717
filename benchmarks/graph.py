"""Measures the speed of graphs of ROS nodes in lock-step, relative to real time.

    python -m benchmarks.graph [--quick] [--json FILE]

Robots with random cells are started as by `snca walk`, without recorder, in a separate ROS domain.
Beside each graph that has a process for each voxel, its floor is measured, see `benchmarks.floor`.
Rates come from the simulation's diagnostics, its count of steps at its own time; CPU time and
memory come from /proc. Latency, from the `odometry` of a step to the next, is measured in a
separate window, since a listener slows the graph down. The start is the time from the command
`snca walk` to the first step. All processes are stopped at the end.
"""

import multiprocessing
import os
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks import floor
from benchmarks.command import run_part
from sim_node.control_time import CONTROL_RATE, step_of_stamp
from sim_node.model.morphology import parse_morphology
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import load_controller, save_controller
from snca_ros.graph.description import NodeProcess, WalkOptions, describe_graph
from snca_ros.graph.environment import graph_environment
from snca_ros.graph.processes import RunningGraph
from snca_ros.trained_controller import TrainedController

CASES = [  # shape, voxels per process
    ('worm', 1), ('biped', 1), ('comb', 1), ('worm-10x2', 1), ('worm-10x3', 1), ('worm-10x4', 1),
    ('biped', 5), ('comb', 6), ('worm-10x2', 10), ('worm-10x4', 10), ('worm-10x4', 20),
    ('worm-10x4', 40), ('worm-20x5', 50),
]
QUICK = [('biped', 1), ('worm-10x2', 1), ('worm-10x4', 1), ('worm-10x4', 20)]

_START_LIMIT = 120.0  # seconds
_SETTLE = 60  # steps before anything is measured
_FEW, _MANY = 10, 40  # voxels, between which the growth of the cost per message is measured
_TICKS = os.sysconf('SC_CLK_TCK')


class Observer:
    """Listens to one graph after another, with the ROS node `node`."""

    def __init__(self) -> None:
        import rclpy
        from diagnostic_msgs.msg import DiagnosticArray
        from rclpy.executors import SingleThreadedExecutor

        self._rclpy = rclpy
        rclpy.init(args=[])
        self.node = rclpy.create_node('benchmark', enable_rosout=False)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self.node)
        self._steps: dict[str, tuple[float, int]] = {}
        self.health: dict[str, tuple[str, dict[str, str]]] = {}  # of each node: text, values
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._note, 10)

    def _note(self, message: Any) -> None:
        stamp = message.header.stamp
        for status in message.status:
            values = {v.key: v.value for v in status.values}
            self.health[status.name] = status.message, values
            made = int(values.get('steps', 0))
            self._steps[status.name] = stamp.sec + stamp.nanosec * 1e-9, made

    def spin_until(self, condition: Callable[[], object], seconds: float) -> None:
        """Process messages until a condition is true; TimeoutError if it takes too long."""
        deadline = time.monotonic() + seconds
        while not condition():
            if time.monotonic() > deadline:
                raise TimeoutError(f'not within {seconds:g} s')
            self._executor.spin_once(0.05)

    def next_count(self, robot: str) -> tuple[float, int]:
        """Return (time [s], steps made) of the simulation's next diagnostics."""
        name = f'/{robot}/sim_node'
        before = self._steps.get(name)
        self.spin_until(lambda: self._steps.get(name) != before, 30.0)
        return self._steps[name]

    @contextmanager
    def arrivals(self, robot: str, latched: bool) -> Iterator[list[tuple[float, int]]]:
        """Collect (time [s], step) of the robot's odometry within the context."""
        from nav_msgs.msg import Odometry
        from rclpy.qos import DurabilityPolicy

        from sim_node.ros.topics import stream_qos

        seen: list[tuple[float, int]] = []

        def note(message: Odometry) -> None:
            stamp = message.header.stamp
            seen.append((time.monotonic(), step_of_stamp(stamp.sec, stamp.nanosec)))

        qos = stream_qos()
        if not latched:
            qos.durability = DurabilityPolicy.VOLATILE
        subscription = self.node.create_subscription(Odometry, f'/{robot}/odometry', note, qos)
        try:
            yield seen
        finally:
            self.node.destroy_subscription(subscription)

    @contextmanager
    def newest_step(self, robot: str) -> Iterator[list[int]]:
        """Provide a list with the newest step of the robot's odometry within the context."""
        from nav_msgs.msg import Odometry

        from sim_node.ros.topics import stream_qos

        newest = [-1]

        def note(message: Odometry) -> None:
            newest[0] = step_of_stamp(message.header.stamp.sec, message.header.stamp.nanosec)

        subscription = self.node.create_subscription(
            Odometry, f'/{robot}/odometry', note, stream_qos()
        )
        try:
            yield newest
        finally:
            self.node.destroy_subscription(subscription)

    def __enter__(self) -> 'Observer':
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._executor.shutdown()
        self.node.destroy_node()
        self._rclpy.try_shutdown()


def write_controller(folder: Path, shape: str) -> Path:
    """Write a controller file with random parameters."""
    morphology, architecture = parse_morphology(shape), Architecture.named('U-nD', 'snn-h')
    rng = np.random.default_rng(0)
    theta = rng.uniform(-1.0, 1.0, architecture.n_parameters(morphology.n_voxels))
    path = folder / f'{shape}.npz'
    save_controller(path, TrainedController(architecture, morphology, theta))
    return path


def cpu_seconds(pid: int) -> float:
    """Return the CPU time that a process has used [s]."""
    fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    return (int(fields[11]) + int(fields[12])) / _TICKS


def memory(pid: int) -> tuple[float, float]:
    """Return (RSS, PSS) of a process [MB]."""
    lines = Path(f'/proc/{pid}/smaps_rollup').read_text().splitlines()[1:]
    sizes = {name: int(size) for name, size, *_ in map(str.split, lines)}
    return sizes['Rss:'] / 1024, sizes['Pss:'] / 1024


def measure_case(path: Path, k: int, seconds: float) -> dict:
    """Return rate, cost, latency and memory of one graph; see `table` for the units."""
    trained = load_controller(path)
    n = trained.morphology.n_voxels
    robot = f'robot_{n}_{k}'
    graph = describe_graph(
        path, trained, WalkOptions(robot=robot, duration=0.0, voxels_per_process=k)
    )
    with RunningGraph(graph, {}) as running, Observer() as observer:
        pids, simulation = running.pids(), graph.simulation
        assert simulation is not None
        with observer.arrivals(robot, latched=True) as seen:
            observer.spin_until(lambda: seen and seen[-1][1] >= _SETTLE, _START_LIMIT)
        begin, first = observer.next_count(robot)
        before = {process: cpu_seconds(pid) for process, pid in pids.items()}
        end, last = begin, first
        while end - begin < seconds:
            end, last = observer.next_count(robot)
        steps = last - first
        cost: dict[NodeProcess, float] = {
            process: (cpu_seconds(pid) - before[process]) / steps * 1e3
            for process, pid in pids.items()
        }
        with observer.arrivals(robot, latched=False) as seen:
            stop = time.monotonic() + seconds / 2
            observer.spin_until(lambda: time.monotonic() > stop, seconds)
        sizes = [memory(pids[process]) for process in graph.voxels]
    voxels = sum(cost[process] for process in graph.voxels)
    gaps = np.diff([t for t, _ in seen]) * 1e3
    rate = steps / (end - begin)
    return {
        'shape': path.stem, 'voxels': n, 'voxels_per_process': k, 'processes': len(graph.voxels),
        'messages': floor.n_messages(trained.morphology),
        'real_time_factor': rate / CONTROL_RATE, 'steps_per_second': rate,
        'cpu_ms_per_step': {
            'all': cost[simulation] + voxels, 'simulation': cost[simulation],
            'voxels': voxels, 'each_voxel': voxels / n,
        },
        'latency_ms': {'p50': float(np.percentile(gaps, 50)),
                       'p99': float(np.percentile(gaps, 99))},
        'process_mb': {'rss': statistics.mean(rss for rss, _ in sizes),
                       'pss': statistics.mean(pss for _, pss in sizes)},
    }


def measure_start(path: Path, robot: str) -> float:
    """Return the time from the command `snca walk` to the first step [s]."""
    command = [sys.executable, '-m', 'snca_ros', 'walk', str(path), '--no-bag',
               '--duration', '30', '--robot', robot]
    with Observer() as observer, observer.arrivals(robot, latched=True) as seen:
        begin = time.monotonic()
        walk = subprocess.Popen(command, stdin=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        try:
            observer.spin_until(lambda: any(step >= 1 for _, step in seen), _START_LIMIT)
        finally:
            walk.terminate()
            walk.wait()
    return next(t for t, step in seen if step >= 1) - begin


def measure(quick: bool) -> dict:
    """Measure graphs and start; return {'graphs': [...], 'start': {...}}.

    Args:
        quick: fewer cases and shorter windows.
    """
    # Domains 1 to 100 are free of the kernel's ephemeral ports.
    os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % 100)
    os.environ.update(graph_environment())
    seconds, starts = (4.0, 1) if quick else (8.0, 5)
    # A new process for each: no graph inherits what the one before has loaded.
    spawn = multiprocessing.get_context('spawn')
    with tempfile.TemporaryDirectory() as folder, spawn.Pool(1, maxtasksperchild=1) as alone:
        biped = write_controller(Path(folder), 'biped')
        times = [alone.apply(measure_start, (biped, f'start_{i}')) for i in range(starts + 1)]
        graphs = []
        for shape, k in QUICK if quick else CASES:
            path = write_controller(Path(folder), shape)
            graphs.append(alone.apply(measure_case, (path, k, seconds)))
            if k == 1:
                graphs[-1]['floor'] = alone.apply(floor.measure_case, (shape,))
    return {
        'graphs': graphs, 'start': {'voxels': 10, 'seconds': times[1:]},
        'holds_60_hz': max((g['voxels'] for g in graphs if g['real_time_factor'] >= 1.0),
                           default=0),
        'holds_60_hz_each_alone': max(
            (g['voxels'] for g in graphs
             if g['real_time_factor'] >= 1.0 and g['voxels_per_process'] == 1),
            default=0,
        ),
    }


def growth(costs: Sequence[dict]) -> float:
    """Return the CPU time per message of 40 voxels over that of 10, of graphs or of floors."""
    few, many = (
        next(c for c in costs if c['voxels'] == n)['cpu_ms_per_step']['all'] for n in (_FEW, _MANY)
    )
    messages = {c['voxels']: c['messages'] for c in costs}
    return many / messages[_MANY] / (few / messages[_FEW])


def table(results: dict) -> str:
    """Return the results of `measure` as text."""
    lines = [
        'x real time  steps/s   CPU per step [ms]: all  of floor  simulation  voxels   each  '
        ' latency [ms] p50   p99   process [MB] RSS   PSS   voxels (per process)'
    ]
    for g in results['graphs']:
        cpu, latency, size = g['cpu_ms_per_step'], g['latency_ms'], g['process_mb']
        ratio = f'{cpu["all"] / g["floor"]["cpu_ms_per_step"]["all"]:.1f}' if 'floor' in g else ''
        lines.append(
            f'{g["real_time_factor"]:11.2f}{g["steps_per_second"]:9.0f}{cpu["all"]:25.2f}'
            f'{ratio:>10}{cpu["simulation"]:12.2f}{cpu["voxels"]:8.2f}{cpu["each_voxel"]:7.3f}'
            f'{latency["p50"]:19.1f}{latency["p99"]:6.1f}{size["rss"]:19.0f}{size["pss"]:6.0f}'
            f'   {g["voxels"]:3} ({g["voxels_per_process"]})'
        )
    start = results['start']['seconds']
    alone = [g for g in results['graphs'] if 'floor' in g]
    lines += [
        f'CPU per message, {_MANY} voxels over {_FEW}: {growth(alone):.2f}, of the floor '
        f'{growth([g["floor"] for g in alone]):.2f}',
        f'60 Hz is held by {results["holds_60_hz"]} voxels, by '
        f'{results["holds_60_hz_each_alone"]} with a process for each',
        f'first step of {results["start"]["voxels"]} voxels after '
        f'{statistics.median(start):.1f} s ({min(start):.1f} to {max(start):.1f})',
    ]
    return '\n'.join(lines)


if __name__ == '__main__':
    run_part(__doc__, measure, table)
