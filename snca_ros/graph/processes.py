"""Starts and ends the processes of a graph and reports their exit codes."""

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

from snca_ros.files import write_text
from snca_ros.graph.child_process import PARENT, name_process
from snca_ros.graph.description import Graph, NodeProcess
from snca_ros.graph.executables import run_node

_POLL_PERIOD = 0.01  # seconds between checks whether a fork has ended
_PATIENCE = 10.0  # seconds that a process has to end after SIGINT before it is killed


class _Fork:
    """A child process that runs a node in a fork of this process, without importing again.

    It has the methods of `subprocess.Popen` that `RunningGraph` uses.
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
                os._exit(code)  # without the parent's clean-up

    def poll(self) -> int | None:
        """Return the exit code, minus its number if a signal ended the child; None if it runs."""
        if self.returncode is None:
            pid, status = os.waitpid(self.pid, os.WNOHANG)
            if pid:
                self.returncode = os.waitstatus_to_exitcode(status)
        return self.returncode

    def wait(self, timeout: float | None = None) -> int:
        """Wait for the exit code and return it, or raise subprocess.TimeoutExpired."""
        deadline = math.inf if timeout is None else time.monotonic() + timeout
        while (code := self.poll()) is None:
            if time.monotonic() > deadline:
                raise subprocess.TimeoutExpired(f'process {self.pid}', timeout or 0.0)
            time.sleep(_POLL_PERIOD)
        return code

    def send_signal(self, number: int) -> None:
        """Send a signal unless the child has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End the child with SIGKILL."""
        self.send_signal(signal.SIGKILL)


def _become_node(arguments: list[str], environment: dict[str, str], title: str) -> int:
    """Run a node in this newly forked process; return its exit code."""
    os.setsid()
    os.dup2(os.open(os.devnull, os.O_RDONLY), 0)
    os.environ.clear()
    os.environ.update(environment)
    name_process(title)
    sys.argv = [sys.argv[0], *arguments]
    return run_node(arguments[0], arguments[1:])


def _can_fork() -> bool:
    """Return whether a fork of this process can run nodes: no threads and no ROS context yet."""
    rclpy = sys.modules.get('rclpy')
    return (
        sys.platform.startswith('linux')
        and threading.active_count() == 1
        and rclpy is not None
        and not rclpy.ok()
    )


class RunningGraph:
    """The running processes of a graph; a context manager that starts and ends them.

    If this process has imported rclpy but not initialised it, voxels are forks of this process:
    each has its own ROS context, and modules and compiled code are loaded once for all of them.

    Args:
        graph: the processes to start.
        environment: variables to add to their environment.
    """

    def __init__(self, graph: Graph, environment: dict[str, str]) -> None:
        self.graph = graph
        self._folder = tempfile.TemporaryDirectory(prefix='snca_ros_')
        self._params = Path(self._folder.name) / 'params.yaml'
        self._environment = {**os.environ, **environment, PARENT: str(os.getpid())}
        self._children: dict[NodeProcess, _Fork | subprocess.Popen] = {}

    def __enter__(self) -> 'RunningGraph':
        write_text(self._params, self.graph.parameters_yaml())
        if _can_fork():
            importlib.import_module('snca_ros.nodes.voxel')
            gc.collect()
            gc.freeze()  # so that the collector does not write to pages shared by the voxels
        try:
            for process in self.graph.processes:
                self._children[process] = self._start(process)
        except BaseException:
            self.__exit__()
            raise
        return self

    def start_again(self, process: NodeProcess, **parameters: object) -> None:
        """Restart a process that has ended, with these `parameters` of its nodes changed."""
        self._children[process] = self._start(process, parameters)

    def kill(self, process: NodeProcess) -> None:
        """End a process with SIGKILL and wait until it has ended."""
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
        # In its own session: Ctrl-C reaches only the walk, which ends the others in order.
        return subprocess.Popen(
            command, env=self._environment, stdin=subprocess.DEVNULL, start_new_session=True
        )

    def __exit__(self, *exc_info: object) -> None:
        """End the simulation, then the voxels, then the recorder; kill what does not end."""
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
        """Return the exit code of a process when it ends, or raise subprocess.TimeoutExpired."""
        return self._children[process].wait(timeout)

    def exit_code(self, process: NodeProcess) -> int | None:
        """Return the exit code of a process, None while it runs."""
        return self._children[process].poll()

    def pids(self) -> dict[NodeProcess, int]:
        """Return the process id of each process."""
        return {process: child.pid for process, child in self._children.items()}

    def ended(self) -> list[NodeProcess]:
        """Return the processes that have ended."""
        return [p for p, child in self._children.items() if child.poll() is not None]
