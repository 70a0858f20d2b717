"""A process that has imported all nodes and runs each node in a fork of itself.

`RunningGraph` starts all processes of a graph this way: imports and compiled code are loaded once
for all of them, also for those that are restarted later. The server has no ROS context, which a
fork could not use. It is a program of its own (`python -m snca_ros.graph.fork_server`), because
the process that starts a graph may have threads and a ROS context.
"""

import gc
import math
import os
import signal
import subprocess
import sys
import time
import traceback
from collections.abc import Callable
from contextlib import suppress
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from typing import Any, NoReturn

from sim_node.ros.stop_signals import blocked_stop_signals
from snca_ros.command_line import load_module
from snca_ros.faults import NO_FAULTS
from snca_ros.graph.child_process import PARENT, end_with_parent, name_process, own_command
from snca_ros.graph.executables import NODES, run_node
from snca_ros.nodes.compiled_step import load_step
from snca_ros.nodes.own_part import load_own_part

_POLL_PERIOD = 0.01  # seconds between checks whether a node process has ended
_NAME = 'fork_server'


class ForkServer:
    """Client of a server process, which it starts; the server ends with `close` or a with block.

    The server ends with its parent and the nodes end with the server, even after SIGKILL.

    Args:
        environment: of the server.

    Attributes:
        pid: process id of the server.
    """

    def __init__(self, environment: dict[str, str]) -> None:
        self._unread = 0  # results that nobody waits for
        self._connection, theirs = Pipe()
        self._process = subprocess.Popen(
            own_command(__name__, str(theirs.fileno())),
            env={**environment, PARENT: str(os.getpid())}, pass_fds=[theirs.fileno()],
            stdin=subprocess.DEVNULL, start_new_session=True,
        )
        theirs.close()
        self.pid = self._process.pid

    def load_cell(self, controller: str, voxel: str) -> None:
        """Have the server load the compiled code of a controller's cells, so that voxels need not.

        This does not wait for it. If the file cannot be read, the voxels say so.

        Args:
            controller: path of the controller file.
            voxel: name of one of its voxels.
        """
        self._connection.send(('load_cell', (controller, voxel)))
        self._unread += 1

    def start(
        self, arguments: list[str], environment: dict[str, str], title: str
    ) -> 'ForkedProcess':
        """Run a node in a new process, in its own session.

        Args:
            arguments: name of the executable and its arguments.
            environment: of the process.
            title: name of the process in `ps`.
        """
        return ForkedProcess(self, self.request('start', arguments, environment, title))

    def request(self, name: str, *arguments: object) -> Any:
        """Have the server call one of its methods; return the result or raise its exception.

        Raises:
            OSError: the server has ended.
        """
        try:
            self._connection.send((name, arguments))
            for _ in range(self._unread):
                self._connection.recv()
                self._unread -= 1
            result = self._connection.recv()
        except EOFError:
            raise ConnectionResetError('the fork server has ended') from None
        if isinstance(result, Exception):
            raise result
        return result

    def __enter__(self) -> 'ForkServer':
        return self

    def __exit__(self, *exc_info: object) -> None:
        self.close()

    def close(self) -> None:
        """End the server, unless it has ended."""
        self._connection.close()
        self._process.wait()


class ForkedProcess:
    """A node process, with the methods of `subprocess.Popen` that `RunningGraph` uses."""

    def __init__(self, server: ForkServer, pid: int) -> None:
        self._server, self.pid = server, pid
        self.returncode: int | None = None

    def poll(self) -> int | None:
        """Return the exit code, minus its number if a signal ended the process; None if it runs."""
        if self.returncode is None:
            try:
                self.returncode = self._server.request('poll', self.pid)
            except OSError:  # without the server, the kernel ends its nodes
                self.returncode = -signal.SIGTERM
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
        """Send a signal unless the process has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End the process with SIGKILL."""
        self.send_signal(signal.SIGKILL)


class _Server:
    """The server: its public methods are the requests."""

    def __init__(self, connection: Connection) -> None:
        self._connection = connection

    def serve(self) -> None:
        """Execute requests until the client ends."""
        with suppress(EOFError, OSError):
            while True:
                self._connection.send(self._execute(*self._connection.recv()))

    def _execute(self, name: str, arguments: tuple) -> Any:
        try:
            return getattr(self, name)(*arguments)
        except Exception as error:
            return error

    def load_cell(self, controller: str, voxel: str) -> None:
        load_step(load_own_part(controller, voxel, NO_FAULTS, ''), voxel)

    def start(self, arguments: list[str], environment: dict[str, str], title: str) -> int:
        environment[PARENT] = str(os.getpid())
        gc.freeze()  # so that the collector does not write to pages that the forks share
        with blocked_stop_signals():  # until the node has installed its handlers
            pid = os.fork()
            if pid == 0:
                self._connection.close()
                run_and_exit(lambda: _become_node(arguments, environment, title))
        return pid

    def poll(self, pid: int) -> int | None:
        ended, status = os.waitpid(pid, os.WNOHANG)
        return os.waitstatus_to_exitcode(status) if ended else None


def _become_node(arguments: list[str], environment: dict[str, str], title: str) -> int:
    """Run a node in this newly forked process; return its exit code."""
    os.setsid()
    os.environ.clear()
    os.environ.update(environment)
    name_process(title)
    sys.argv = [sys.argv[0], *arguments]
    return run_node(arguments[0], arguments[1:])


def run_and_exit(run: Callable[[], int]) -> NoReturn:
    """End this process, a fork, with the exit code that `run` returns, without clean-up."""
    code = 1
    try:
        code = run()
    except SystemExit as stop:
        code = int(stop.code or 0)
    except BaseException:
        traceback.print_exc()
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def main() -> int:
    """Run the server on the connection that the command line names; return the exit code."""
    end_with_parent()
    name_process(_NAME)
    connection = Connection(int(sys.argv[1]))
    for module, _ in NODES.values():
        load_module(module)
    _Server(connection).serve()
    return 0


if __name__ == '__main__':
    sys.exit(main())
