"""Counts the processors that this process may use."""

import math
import os
from pathlib import Path

_OWN, _ALL = Path('/proc/self/cgroup'), Path('/sys/fs/cgroup')


def available_processors() -> int:
    """Return the number of processors of this process's affinity and its cgroups' quotas.

    A part of a processor counts as one.
    """
    if hasattr(os, 'process_cpu_count'):  # since Python 3.13; it knows PYTHON_CPU_COUNT
        n = os.process_cpu_count() or 1
    elif hasattr(os, 'sched_getaffinity'):
        n = len(os.sched_getaffinity(0))
    else:
        n = os.cpu_count() or 1
    return max(1, math.ceil(min(n, cgroup_quota())))


def cgroup_quota(own: Path = _OWN, everything: Path = _ALL) -> float:
    """Return how many processors the cgroups of this process may keep busy; inf for any number.

    Args:
        own: file that names the cgroups of this process, of version 1 and 2.
        everything: folder in which the hierarchies of cgroups are mounted.
    """
    try:
        lines = own.read_text().splitlines()
    except OSError:
        return math.inf
    quotas = [math.inf]
    for line in lines:
        _, controllers, path = line.split(':', 2)
        if not controllers:
            quotas += _of_ancestors(path, everything, everything / 'unified')
        elif 'cpu' in controllers.split(','):
            quotas += _of_ancestors(path, everything / 'cpu', everything / controllers)
    return min(quotas)


def _of_ancestors(path: str, *mounts: Path) -> list[float]:
    """Return the quotas of a cgroup and of all that contain it."""
    relative = Path(path.lstrip('/'))
    return [
        _quota(mount / folder) for mount in mounts for folder in (relative, *relative.parents)
    ]


def _quota(folder: Path) -> float:
    """Return the quota of a cgroup's folder, of either version."""
    try:
        if (folder / 'cpu.max').exists():
            quota, period = (folder / 'cpu.max').read_text().split()
        else:
            quota, period = (
                (folder / f'cpu.cfs_{name}_us').read_text() for name in ('quota', 'period')
            )
        return int(quota) / int(period) if int(quota) > 0 else math.inf
    except (OSError, ValueError, ZeroDivisionError):  # none here, or 'max'
        return math.inf
