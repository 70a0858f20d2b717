"""What tests see of foreign processes, which send no event."""

import threading
from pathlib import Path

TICK = threading.Event()


def wait_for(condition, seconds=60.0):
    """Poll what no event tells: the state of foreign processes."""
    for _ in range(int(seconds / 0.05)):
        if found := condition():
            return found
        TICK.wait(0.05)
    raise AssertionError('the condition never came true')


def children_of(pid: int) -> list[int]:
    """Return the pids of the living children of a process."""
    found = []
    for stat in Path('/proc').glob('[0-9]*/stat'):
        try:
            fields = stat.read_text().rpartition(')')[2].split()
        except OSError:
            continue
        if int(fields[1]) == pid and fields[0] != 'Z':
            found.append(int(stat.parent.name))
    return found


def is_alive(pid: int) -> bool:
    """Tell whether a process runs; a zombie does not."""
    try:
        return Path(f'/proc/{pid}/stat').read_text().rpartition(')')[2].split()[0] != 'Z'
    except OSError:
        return False
