"""`snca` as a fork of a server that has imported everything: the same, without the imports.

A graph test starts many processes, and each would import for a second. `Forks.start` gives what
`subprocess.Popen` of `python -m snca_ros` gives; some tests use that one, too.
"""

import gc
import os
import signal
import subprocess
import sys
import threading
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path

from support.limits import be_patient
from support.paths import ROOT

from snca_ros.graph.child_process import PARENT, end_with_parent
from snca_ros.graph.fork_server import run_and_exit


class Forks:
    """Client of a server, which it starts in this environment; it ends with `close`."""

    def __init__(self) -> None:
        self._connection, theirs = Pipe()
        path = os.pathsep.join([str(ROOT), str(ROOT / 'test')])
        self._process = subprocess.Popen(
            [sys.executable, '-m', 'support.forks', str(theirs.fileno())],
            env={**os.environ, 'PYTHONPATH': path, PARENT: str(os.getpid())},
            pass_fds=[theirs.fileno()], stdin=subprocess.DEVNULL,
        )
        theirs.close()

    def start(self, arguments: list[str], environment: dict[str, str], cwd: Path) -> 'Fork':
        """Run `snca` with these arguments in a new process."""
        ours, theirs = os.pipe()
        output = f'/proc/{os.getpid()}/fd/{theirs}'
        pid = self.request('start', arguments, environment, str(cwd), output)
        os.close(theirs)
        return Fork(self, pid, ours)

    def request(self, name: str, *arguments: object) -> object:
        """Return what the server answers."""
        self._connection.send((name, arguments))
        return self._connection.recv()

    def close(self) -> None:
        """End the server."""
        self._connection.close()
        self._process.wait()


class Fork:
    """A process, with those methods of `subprocess.Popen` that tests use."""

    def __init__(self, forks: Forks, pid: int, output: int) -> None:
        self._forks, self.pid, self.returncode = forks, pid, None
        self.stdout = os.fdopen(output, encoding='utf-8', errors='replace')
        self._read: list[str] = []
        self._reader: threading.Thread | None = None

    def poll(self) -> int | None:
        """Return the exit code, None while it runs."""
        if self.returncode is None:
            self.returncode = self._forks.request('poll', self.pid)
        return self.returncode

    def wait(self, timeout: float) -> int:
        """Return the exit code when the process ends."""
        from support.processes import wait_until  # which is not for the server

        wait_until(lambda: self.poll() is not None, f'the end of {self.pid}', timeout)
        assert self.returncode is not None
        return self.returncode

    def communicate(self, timeout: float) -> tuple[str, None]:
        """Return all output that is not read yet, when the process and its children have ended."""
        if self._reader is None:
            self._reader = threading.Thread(
                target=lambda: self._read.append(self.stdout.read()), daemon=True
            )
            self._reader.start()
        self._reader.join(timeout)
        if self._reader.is_alive():
            raise subprocess.TimeoutExpired(f'process {self.pid}', timeout)
        self.wait(timeout)
        return ''.join(self._read), None

    def send_signal(self, number: int) -> None:
        """Send a signal unless the process has ended."""
        if self.poll() is None:
            os.kill(self.pid, number)

    def kill(self) -> None:
        """End the process."""
        self.send_signal(signal.SIGKILL)


def _become_snca(
    arguments: list[str], environment: dict[str, str], cwd: str, descriptor: int
) -> int:
    """Run `snca` in this newly forked process; return its exit code."""
    for standard in (1, 2):
        os.dup2(descriptor, standard)
    os.closerange(3, 1024)
    # The server's own streams may be those of a file, which knows its position.
    sys.stdout, sys.stderr = (open(n, 'w', closefd=False) for n in (1, 2))  # noqa: SIM115
    os.chdir(cwd)
    os.environ.clear()
    os.environ.update({**environment, PARENT: str(os.getppid())})
    sys.argv = ['snca_ros', *arguments]
    return run()


def start(arguments: list[str], environment: dict[str, str], cwd: str, output: str) -> int:
    """Fork a process in the server; return its id."""
    gc.freeze()
    descriptor = os.open(output, os.O_WRONLY)
    pid = os.fork()
    if pid == 0:
        run_and_exit(lambda: _become_snca(arguments, environment, cwd, descriptor))
    os.close(descriptor)
    return pid


def run() -> int:
    """Run the command line of this process."""
    from snca_ros.cli import main

    return main()


def poll(pid: int) -> int | None:
    """Return the exit code of a fork, None while it runs."""
    ended, status = os.waitpid(pid, os.WNOHANG)
    return os.waitstatus_to_exitcode(status) if ended else None


def serve(connection: Connection) -> None:
    """Answer requests until the client ends."""
    answers = {'start': start, 'poll': poll}
    while True:
        try:
            name, arguments = connection.recv()
        except EOFError:
            return
        connection.send(answers[name](*arguments))


def import_everything() -> None:
    """Import what nodes and walks use, and load the compiled code of both."""
    from support.warm import warm

    from snca_ros.command_line import load_module
    from snca_ros.commands import load_command
    from snca_ros.graph.executables import NODES

    be_patient()
    for module, _ in NODES.values():
        load_module(module)
    load_command('walk')
    warm()


if __name__ == '__main__':
    end_with_parent()
    import_everything()
    serve(Connection(int(sys.argv[1])))
