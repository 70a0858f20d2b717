"""Child processes: their command line, their end with their parent, and their names in `ps`."""

import ctypes
import os
import signal
import sys

PARENT = 'SNCA_ROS_PARENT'
"""Environment variable that holds the process id of the parent."""

_PR_SET_PDEATHSIG, _PR_SET_NAME = 1, 15


def own_command(*arguments: str) -> list[str]:
    """Return the command line that runs `snca` with these arguments in a new process.

    The new process imports modules from the same folders as this one. `python -m snca_ros` would
    first look in the working directory, where a random.py may lie.
    """
    folders = [folder for folder in sys.path if folder]
    program = (
        f'import sys; sys.path[:] = {folders}; from snca_ros.cli import main; sys.exit(main())'
    )
    return [sys.executable, '-c', program, *arguments]


def end_with_parent() -> None:
    """Make the kernel end this process when the process that started the graph ends."""
    parent = os.environ.pop(PARENT, '')
    if not parent or not sys.platform.startswith('linux'):
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):
        raise SystemExit(0)


def name_process(name: str) -> None:
    """Set the name of this process in `ps` and `top`, which show 15 characters of it."""
    ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode())
