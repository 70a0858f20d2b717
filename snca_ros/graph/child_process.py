"""Processes that must not outlive the one that started them."""

import ctypes
import os
import signal
import sys

PARENT = 'SNCA_ROS_PARENT'
"""Environment variable in which a parent hands its process id to its children."""

_PR_SET_PDEATHSIG, _PR_SET_NAME = 1, 15


def end_with_parent() -> None:
    """Let this process end when the process that started the graph ends, however it does."""
    parent = os.environ.pop(PARENT, '')
    if not parent or not sys.platform.startswith('linux'):
        return
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
    if os.getppid() != int(parent):
        raise SystemExit(0)


def name_process(name: str) -> None:
    """Let `ps` and `top` show this process by a name, of which they keep 15 characters."""
    ctypes.CDLL(None).prctl(_PR_SET_NAME, name.encode())
