"""Child processes: their command line, their end with their parent, and their names in `ps`."""

import ctypes
import os
import signal
import sys
from pathlib import Path

PARENT = 'SNCA_ROS_PARENT'
"""Environment variable that holds the process id of the process that starts a graph."""

_PR_SET_PDEATHSIG, _PR_SET_NAME = 1, 15


def own_command(module: str, *arguments: str) -> list[str]:
    """Return the command line that runs a module of this project in a new process.

    The new process imports modules from the same folders as this one. `python -m` would first look
    in the working directory, where a random.py may lie.
    """
    folders = [folder for folder in sys.path if folder]
    program = (
        f'import runpy, sys; sys.path[:] = {folders}; '
        f'runpy.run_module({module!r}, run_name="__main__", alter_sys=True)'
    )
    return [sys.executable, '-c', program, *arguments]


def end_with_parent() -> None:
    """Make the kernel end this process, by SIGTERM, when the process that started it ends.

    The environment names the process that started the graph. It need not be the parent: a
    debugger or a terminal may have been put in between.
    """
    starter = os.environ.pop(PARENT, '')
    if not starter or not sys.platform.startswith('linux'):
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(starter) and not Path(f'/proc/{starter}').exists():
        raise SystemExit(0)


def name_process(name: str) -> None:
    """Set the name of this process in `ps` and `top`, which show 15 characters of it."""
    if sys.platform.startswith('linux'):
        ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode())
