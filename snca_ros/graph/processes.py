"""Starts and ends the processes of a graph and reports their exit codes."""

import os
import signal
import tempfile
import time
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from sim_node.ros.deadlines import ListeningTime
from snca_ros.files import write_text
from snca_ros.graph.description import Graph, NodeProcess
from snca_ros.graph.fork_server import ForkedProcess, ForkServer

_POLL_PERIOD = 0.01  # seconds between checks whether processes have ended
_PATIENCE = 10.0  # seconds that a process has to end after SIGINT before it is killed


def start_server(graph: Graph, environment: dict[str, str]) -> ForkServer:
    """Return a server for the processes of a graph, which loads their code from now on."""
    server = ForkServer({**os.environ, **environment})
    for process in graph.voxels[:1]:
        controller = process.parameters[process.name]['controller']
        server.load_cell(str(controller), process.name)
    return server


class RunningGraph:
    """The running processes of a graph; a context manager that starts and ends them.

    Args:
        graph: the processes to start.
        environment: variables to add to their environment.
        server: of which the processes are forks, which is ended with them; None for a new one.
    """

    def __init__(
        self, graph: Graph, environment: dict[str, str], server: ForkServer | None = None
    ) -> None:
        self.graph, self._given_server = graph, server
        self._environment = {**os.environ, **environment}
        self._children: dict[NodeProcess, ForkedProcess] = {}

    def __enter__(self) -> 'RunningGraph':
        self._folder = tempfile.TemporaryDirectory(prefix='snca_ros_')
        self._params = Path(self._folder.name) / 'params.yaml'
        write_text(self._params, self.graph.parameters_yaml())
        self._server = self._given_server or start_server(self.graph, self._environment)
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
    ) -> ForkedProcess:
        arguments = [
            process.executable, *process.names,
            '--ros-args', '-r', f'__ns:=/{self.graph.robot}', '--params-file', str(self._params),
            '--enclave', self.graph.enclave(process.name),
            *(word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')),
        ]
        return self._server.start(arguments, self._environment, process.name)

    def __exit__(self, *exc_info: object) -> None:
        """End the simulation, then the voxels, then the recorder; kill what does not end."""
        graph = self.graph
        for group in ((graph.simulation,), graph.voxels, (graph.recorder,)):
            self._end([self._children[p] for p in group if p and p in self._children])
        self._server.close()
        self._folder.cleanup()

    @staticmethod
    def _end(children: list[ForkedProcess]) -> None:
        for child in children:
            child.send_signal(signal.SIGINT)
        waited = ListeningTime()
        while any(child.poll() is None for child in children) and waited.now() < _PATIENCE:
            time.sleep(_POLL_PERIOD)
        for child in children:
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
