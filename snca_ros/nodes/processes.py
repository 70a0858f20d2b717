"""Starting, watching and ending the processes of a graph, leaving none behind."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from snca_ros.nodes.bringup import Graph, NodeProcess
from snca_ros.nodes.lifeline import PARENT

_PATIENCE = 10.0  # seconds for a process to end by itself before it is killed


class RunningGraph:
    """The processes of a graph; a context manager that ends them all.

    Args:
        graph: what to start.
        environment: added to the processes' environment.
    """

    def __init__(self, graph: Graph, environment: dict[str, str]) -> None:
        self.graph = graph
        self._folder = tempfile.TemporaryDirectory(prefix='snca_ros_')
        self._environment = {**os.environ, **environment, PARENT: str(os.getpid())}
        self._children: dict[NodeProcess, subprocess.Popen] = {}

    def __enter__(self) -> 'RunningGraph':
        params = Path(self._folder.name) / 'params.yaml'
        params.write_text(self.graph.parameters_yaml())
        try:
            for process in self.graph.processes:
                self._children[process] = self._start(process, params)
        except BaseException:
            self.__exit__()
            raise
        return self

    def _start(self, process: NodeProcess, params: Path) -> subprocess.Popen:
        command = [
            sys.executable, '-m', 'snca_ros', process.executable, *process.names,
            '--ros-args', '-r', f'__ns:=/{self.graph.robot}', '--params-file', str(params),
        ]
        # A session of its own: Ctrl-C reaches the walk alone, which ends the others in order.
        return subprocess.Popen(
            command, env=self._environment, stdin=subprocess.DEVNULL, start_new_session=True
        )

    def __exit__(self, *exc_info: object) -> None:
        """End the simulation, then the voxels, then the recorder, each cleanly if it can."""
        graph = self.graph
        for group in ((graph.simulation,), graph.voxels, (graph.recorder,)):
            self._end([self._children[p] for p in group if p in self._children])
        self._folder.cleanup()

    @staticmethod
    def _end(children: list[subprocess.Popen]) -> None:
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
