"""The network between the machines that share a robot."""

import sys
import time
from pathlib import Path

_PATIENCE, _LOOK_PERIOD = 10.0, 0.05  # s


def await_network(interfaces: Path = Path('/sys/class/net'), patience: float = _PATIENCE) -> None:
    """Wait until an interface beside the loopback runs, at most `patience` seconds.

    Fast DDS uses the interfaces that run when a node starts. A machine that boots starts its
    nodes before; and of a new virtual cable the kernel says up to a second late that it runs.
    """
    states = [p / 'operstate' for p in interfaces.glob('*') if p.name != 'lo']
    deadline = time.monotonic() + patience
    while states and not any(_runs(state) for state in states):
        if time.monotonic() > deadline:
            names = ', '.join(sorted(state.parent.name for state in states))
            print(f'no network: of {names} none runs; going on without', file=sys.stderr)
            return
        time.sleep(_LOOK_PERIOD)


def _runs(state: Path) -> bool:
    try:
        return state.read_text().strip() in ('up', 'unknown')  # tunnels are never said to be up
    except OSError:  # unplugged meanwhile
        return False
