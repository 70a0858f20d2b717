"""Waits for a network interface, for robots whose voxels run on several machines."""

import sys
import time
from pathlib import Path

_PATIENCE, _POLL_PERIOD = 10.0, 0.05  # s


def await_network(interfaces: Path = Path('/sys/class/net'), patience: float = _PATIENCE) -> None:
    """Wait until an interface other than the loopback is up, at most `patience` seconds.

    Fast DDS uses only the interfaces that are up when a node starts. A booting machine may start
    nodes earlier, and the kernel reports a new veth pair as up with a delay of up to a second.

    Args:
        interfaces: folder of sysfs with a subfolder per interface.
        patience: how long to wait [s].
    """
    states = [p / 'operstate' for p in interfaces.glob('*') if p.name != 'lo']
    deadline = time.monotonic() + patience
    while states and not any(_is_up(state) for state in states):
        if time.monotonic() > deadline:
            names = ', '.join(sorted(state.parent.name for state in states))
            print(f'no network interface is up ({names}); starting anyway', file=sys.stderr)
            return
        time.sleep(_POLL_PERIOD)


def _is_up(state: Path) -> bool:
    try:
        return state.read_text().strip() in ('up', 'unknown')  # tunnels are never reported as up
    except OSError:  # the interface was removed
        return False
