"""(ROS) Runs a graph until its simulation ends, and handles processes that end early."""

import os
import sys
import time
from collections.abc import Callable
from typing import Protocol

import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node

from sim_node.control_time import CONTROL_RATE
from sim_node.ros.context import start_ros
from sim_node.ros.interface import DIAGNOSTICS
from sim_node.ros.stop_signals import StopRequest
from snca_ros.graph.description import Graph, NodeProcess, WalkOptions
from snca_ros.graph.environment import graph_environment
from snca_ros.graph.fork_server import ForkServer
from snca_ros.graph.network import await_network
from snca_ros.graph.processes import RunningGraph
from snca_ros.progress import StatusLine

_POLL_PERIOD = 0.2  # seconds between checks whether a process has ended


class View(Protocol):
    """A live view of a walk, such as `snca_ros.graph.live_view.LiveView`."""

    address: str

    def spin_once(self) -> None:
        """Update the view and execute its commands, for at most the period of a frame."""

    def close(self) -> None:
        """Close the view."""


def supervise_walk(
    graph: Graph,
    options: WalkOptions,
    respawn: bool = False,
    open_view: Callable[[RunningGraph], View] | None = None,
    server: ForkServer | None = None,
) -> int:
    """Run a graph until its simulation ends.

    Progress, and processes that end early, are reported on standard error.

    Args:
        graph: with its simulation on this machine.
        options: of the walk. In lock-step a voxel that ends also ends the walk; in real time the
            walk continues without it.
        respawn: whether to restart voxels that a signal has ended.
        open_view: opens a live view of the running graph.
        server: see `RunningGraph`.

    Returns:
        0, or 1 if a process failed.

    Raises:
        KeyboardInterrupt: SIGINT or SIGTERM has ended the walk.
    """
    environment = graph_environment(options.reach)
    os.environ.update(environment)
    if options.only:
        await_network()
    with StopRequest() as stop, RunningGraph(graph, environment, server) as running:
        return _watch_walk(running, stop, options, respawn, open_view)


def supervise_voxels(graph: Graph, respawn: bool = False) -> int:
    """Run voxels of a graph whose simulation is on another machine, until the simulation ends.

    Args:
        graph: without simulation; its voxels end by themselves after one walk.
        respawn: whether to restart voxels that a signal has ended.

    Returns:
        0, or 1 if a voxel failed.

    Raises:
        KeyboardInterrupt: SIGINT or SIGTERM has ended the voxels.
    """
    environment = graph_environment('network')
    os.environ.update(environment)
    await_network()
    with StopRequest() as stop, RunningGraph(graph, environment) as running:
        return _watch_voxels(running, stop, respawn)


class _Watch:
    """Reports processes of a running graph that have ended early, and restarts them.

    Args:
        running: the graph.
        respawn: whether to restart processes that a signal has ended.

    Attributes:
        given_up: processes that have ended and are not restarted.
    """

    def __init__(self, running: RunningGraph, respawn: bool) -> None:
        self._running, self._respawn = running, respawn
        self.given_up: set[NodeProcess] = set()

    def ended(self) -> list[tuple[NodeProcess, int]]:
        """Return the processes that have ended and are not given up, with their exit codes."""
        ended = self._running.ended()
        self.given_up.intersection_update(ended)  # a live view may have restarted some
        return [(p, self._running.wait(p, 0.0)) for p in ended if p not in self.given_up]

    def start_again(self, process: NodeProcess, code: int, message: str) -> bool:
        """Restart a process if a signal has ended it; return whether it was restarted."""
        if not self._respawn or code >= 0:  # minus the number of a signal
            return False
        print(f'{message}: restarted', file=sys.stderr)
        self._running.start_again(process)
        return True


class _Progress:
    """Shows the progress of a walk on a terminal, from the diagnostics of its simulation."""

    def __init__(self, node: Node, robot: str, duration: float) -> None:
        self._name, self._duration, self._steps = f'/{robot}/sim_node', duration, 0
        self._line = StatusLine()
        node.create_subscription(DiagnosticArray, DIAGNOSTICS.name, self._note, 10)

    def _note(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == self._name:
                counters = {v.key: v.value for v in status.values}
                if counters.get('steps', '').isdecimal():
                    self._steps = int(counters['steps'])

    def show(self) -> None:
        """Show the simulated time so far."""
        self._line.show(f'{self._steps / CONTROL_RATE:7.1f} of {self._duration:g} s')

    def finish(self) -> None:
        """Remove the line, since the walk has ended."""
        self._line.clear()


def _watch_walk(
    running: RunningGraph,
    stop: StopRequest,
    options: WalkOptions,
    respawn: bool,
    open_view: Callable[[RunningGraph], View] | None,
) -> int:
    graph, watch, view = running.graph, _Watch(running, respawn), None
    assert graph.simulation is not None
    arguments = ['--ros-args', '--enclave', graph.enclave('walk')]
    start_ros(arguments)
    try:
        node = rclpy.create_node('walk', namespace=f'/{graph.robot}', enable_rosout=False)
        progress = _Progress(node, graph.robot, options.duration)
        if open_view:
            view = open_view(running)
            print(f'live view: {view.address}', file=sys.stderr, flush=True)
        while running.exit_code(graph.simulation) is None:
            stop.raise_if_requested()
            rclpy.spin_once(node, timeout_sec=0.0 if view else _POLL_PERIOD)
            if view:
                view.spin_once()
            progress.show()
            if not _can_continue(graph, watch, options.real_time_factor > 0.0):
                return 1
        progress.finish()
        node.destroy_node()
    finally:
        if view:
            view.close()
        rclpy.try_shutdown()
    return 0 if running.exit_code(graph.simulation) == 0 else 1


def _can_continue(graph: Graph, watch: _Watch, real_time: bool) -> bool:
    """Restart or report the processes that have ended; return whether the walk can continue."""
    for process, code in watch.ended():
        if process is graph.simulation:
            continue
        message = f'\n{process.executable} {" ".join(process.names)} ended with code {code}'
        is_voxel = process in graph.voxels
        if is_voxel and watch.start_again(process, code, message):
            continue
        if not (is_voxel and real_time):
            print(message, file=sys.stderr)
            return False
        print(f'{message}: the walk continues without it', file=sys.stderr)
        watch.given_up.add(process)
    return True


def _watch_voxels(running: RunningGraph, stop: StopRequest, respawn: bool) -> int:
    """Wait until a voxel ends because its simulation has ended, or until all voxels have failed."""
    watch = _Watch(running, respawn)
    while len(watch.given_up) < len(running.graph.voxels):
        stop.raise_if_requested()
        time.sleep(_POLL_PERIOD)
        for process, code in watch.ended():
            if code == 0:
                return 1 if watch.given_up else 0
            message = f'{" ".join(process.names)} ended with code {code}'
            if not watch.start_again(process, code, message):
                print(message, file=sys.stderr)
                watch.given_up.add(process)
    return 1
