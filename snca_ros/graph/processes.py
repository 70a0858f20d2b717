"""Starting, watching and ending the processes of a graph, leaving none behind."""

import gc
import importlib
import math
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
import traceback
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from snca_ros.graph.child_process import PARENT, name_process
from snca_ros.graph.description import Graph, NodeProcess
from snca_ros.graph.executables import run_node

_LOOK_PERIOD = 0.01  # seconds between looks at whether a fork has ended
_PATIENCE = 10.0  # seconds for a process to end by itself before it is killed


class _Fork:
    """A child that goes on as a node in a copy of this process: nothing is imported again.

    What `RunningGraph` uses of `subprocess.Popen`.
    """

    def __init__(self, arguments: list[str], environment: dict[str, str], title: str) -> None:
        self.returncode: int | None = None
        sys.stdout.flush()
        sys.stderr.flush()
        self.pid = os.fork()
        if self.pid == 0:
            code = 1
            try:
                code = _become_node(arguments, environment, title)
            except KeyboardInterrupt:
                code = 0
            except SystemExit as stop:
                code = int(stop.code or 0)
            except BaseException:
                traceback.print_exc()
            finally:
                sys.stdout.flush()
                sys.stderr.flush()
                os._exit(code)  # what else this process was about to do is its parent's to do

    def poll(self) -> int | None:
        """Return the exit code, minus the signal's number if one ended it, None while it runs."""
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the exit code; subprocess.TimeoutExpired."""
        deadline = math.inf if timeout is None else time.monotonic() + timeout
        while (code := self.poll()) is None:
            if time.monotonic() > deadline:
                raise subprocess.TimeoutExpired(f'process {self.pid}', timeout or 0.0)
            time.sleep(_LOOK_PERIOD)
        return code

    def send_signal(self, number: int) -> None:
        """Send a signal, unless the child has ended and been noticed."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End it at once."""
        self.send_signal(signal.SIGKILL)


def _become_node(arguments: list[str], environment: dict[str, str], title: str) -> int:
    """Run a node in a process that was just forked; return its exit code."""
    os.setsid()
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.environ.clear()
    os.environ.update(environment)
    name_process(title)
    sys.argv = [sys.argv[0], *arguments]
    return run_node(arguments[0], arguments[1:])


def _can_fork() -> bool:
    """Tell whether a copy of this process could start nodes: no threads, and no ROS at work."""
    rclpy = sys.modules.get('rclpy')
    return (
        sys.platform.startswith('linux')
        and threading.active_count() == 1
        and rclpy is not None
        and not rclpy.ok()
    )


class RunningGraph:
    """The processes of a graph; a context manager that ends them all.

    Where this process has loaded ROS but not yet begun to use it, the voxels are forks of it. Each
    has its own ROS context all the same, but what all of them import and compile is loaded once.

    Args:
        graph: what to start.
        environment: added to the processes' environment.
    """

    def __init__(self, graph: Graph, environment: dict[str, str]) -> None:
        self.graph = graph
        self._folder = tempfile.TemporaryDirectory(prefix='snca_ros_')
        self._params = Path(self._folder.name) / 'params.yaml'
        self._environment = {**os.environ, **environment, PARENT: str(os.getpid())}
        self._children: dict[NodeProcess, _Fork | subprocess.Popen] = {}

    def __enter__(self) -> 'RunningGraph':
        self._params.write_text(self.graph.parameters_yaml())
        if _can_fork():
            importlib.import_module('snca_ros.nodes.voxel')
            gc.collect()
            gc.freeze()  # the collector shall not write into the pages that the voxels share
        try:
            for process in self.graph.processes:
                self._children[process] = self._start(process)
        except BaseException:
            self.__exit__()
            raise
        return self

    def start_again(self, process: NodeProcess, **parameters: object) -> None:
        """Start a process that has ended once more, with other `parameters` if any are given."""
        self._children[process] = self._start(process, parameters)

    def kill(self, process: NodeProcess) -> None:
        """End a process as `kill -9` does, and wait until it has ended."""
        self._children[process].kill()
        self._children[process].wait()

    def _start(
        self, process: NodeProcess, parameters: Mapping[str, object] = MappingProxyType({})
    ) -> '_Fork | subprocess.Popen':
        arguments = [
            process.executable, *process.names,
            '--ros-args', '-r', f'__ns:=/{self.graph.robot}', '--params-file', str(self._params),
            '--enclave', self.graph.enclave(process.name),
            *(word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')),
        ]
        if process in self.graph.voxels and _can_fork():
            return _Fork(arguments, self._environment, process.name)
        command = [sys.executable, '-m', 'snca_ros', *arguments]
        # A session of its own: Ctrl-C reaches the walk alone, which ends the others in order.
        return subprocess.Popen(
            command, env=self._environment, stdin=subprocess.DEVNULL, start_new_session=True
        )

    def __exit__(self, *exc_info: object) -> None:
        """End the simulation, then the voxels, then the recorder, each cleanly if it can."""
        graph = self.graph
        for group in ((graph.simulation,), graph.voxels, (graph.recorder,)):
            self._end([self._children[p] for p in group if p and p in self._children])
        self._folder.cleanup()

    @staticmethod
    def _end(children: 'list[_Fork | subprocess.Popen]') -> None:
        for child in children:
            if child.poll() is None:
                child.send_signal(signal.SIGINT)
        deadline = time.monotonic() + _PATIENCE
        for child in children:
            try:
                child.wait(max(0.0, deadline - time.monotonic()))
            except subprocess.TimeoutExpired:
                child.kill()
                child.wait()

    def wait(self, process: NodeProcess, timeout: float) -> int:
        """Wait until a process ends and return its exit code; subprocess.TimeoutExpired."""
        return self._children[process].wait(timeout)

    def exit_code(self, process: NodeProcess) -> int | None:
        """Return the exit code of a process, None while it runs."""
        return self._children[process].poll()

    def pids(self) -> dict[NodeProcess, int]:
        """Return the process ids."""
        return {process: child.pid for process, child in self._children.items()}

    def ended(self) -> list[NodeProcess]:
        """Return the processes that have ended."""
        return [p for p, child in self._children.items() if child.poll() is not None]
