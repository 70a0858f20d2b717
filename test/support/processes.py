"""What tests see of foreign processes, which send no event."""

import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path

from support.limits import LIMIT

SERVER = 'fork_server'  # name of the parent of a walk's nodes
TICK = threading.Event()


def wait_until(
    condition: Callable[[], object], what: str = 'a condition', limit: float = LIMIT
) -> object:
    """Poll a condition until it is true; return its value."""
    begin = now = time.monotonic()
    while not (found := condition()):
        asked, now = now, time.monotonic()
        assert now < begin + limit, f'waited in vain for {what}'
        TICK.wait(max(0.02, 3.0 * (now - asked)))  # leaves the machine to those it waits for
        now = time.monotonic()
    return found


def stat_of(pid: int) -> tuple[str, int, str] | None:
    """Return (state, parent, start time) of a process, or None if there is none."""
    try:
        fields = Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()
    except OSError:
        return None
    return fields[0], int(fields[1]), fields[19]


def children_of(*pids: int) -> dict[int, str]:
    """Return the running children of processes: id to start time."""
    stats = {int(p.name): stat_of(int(p.name)) for p in Path('/proc').glob('[0-9]*')}
    return {
        child: stat[2] for child, stat in stats.items()
        if stat and stat[1] in pids and stat[0] not in 'ZX'
    }


def offspring(pid: int) -> dict[int, str]:
    """Return children, grandchildren and so on of a process: id to start time."""
    found, parents = {}, [pid]
    while parents:
        new = children_of(*parents)
        found |= new
        parents = list(new)
    return found


def nodes_of(pid: int) -> dict[str, int]:
    """Return the running node processes of a walk: name to process id."""
    found = {name_of(child): child for child in offspring(pid)}
    return {name: child for name, child in found.items() if name not in ('', SERVER)}


def name_of(pid: int) -> str:
    """Return the name of a process, '' if there is none."""
    try:
        return Path(f'/proc/{pid}/comm').read_text().strip()
    except OSError:
        return ''


def is_alive(pid: int, started: str | None = None) -> bool:
    """Return whether a process runs, which began at `started` if given; a zombie does not."""
    stat = stat_of(pid)
    return stat is not None and started in (None, stat[2]) and stat[0] not in 'ZX'


def wait_until_gone(processes: dict[int, str]) -> None:
    """Wait until processes (id to start time) have ended, and kill those that do not end."""
    def alive() -> list[int]:
        return [pid for pid, started in processes.items() if is_alive(pid, started)]

    try:
        wait_until(lambda: not alive(), f'the end of {sorted(processes)}', limit=LIMIT)
    finally:
        for pid in alive():
            os.kill(pid, signal.SIGKILL)
