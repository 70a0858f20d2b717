"""How many processors this process may use, by its affinity and the quotas of its cgroups."""

import math
import os
import sys

import pytest

from snca_ros.evolution import processors
from snca_ros.evolution.processors import available_processors, cgroup_quota


@pytest.mark.parametrize(('own', 'files', 'quota'), [
    ('0::/', {'cpu.max': '150000 100000'}, 1.5),
    ('0::/', {'cpu.max': 'max 100000'}, math.inf),
    ('0::/a/b', {'a/cpu.max': '50000 100000', 'a/b/cpu.max': 'max 100000'}, 0.5),
    ('0::/a/b', {'unified/a/b/cpu.max': '200000 100000'}, 2.0),
    ('3:cpu,cpuacct:/a\n2:memory:/m\n0::/', {
        'cpu/a/cpu.cfs_quota_us': '300000', 'cpu/a/cpu.cfs_period_us': '100000',
        'cpu/cpu.cfs_quota_us': '-1', 'cpu/cpu.cfs_period_us': '100000',
        'memory/m/cpu.cfs_quota_us': '1', 'memory/m/cpu.cfs_period_us': '100000',
    }, 3.0),
    ('1:cpu:/', {'cpu/cpu.cfs_quota_us': '-1', 'cpu/cpu.cfs_period_us': '100000'}, math.inf),
    ('0::/gone', {'cpu.max': 'junk'}, math.inf),
    (None, {}, math.inf),
])
def test_quotas_of_cgroups(own, files, quota, tmp_path):
    if own is not None:
        (tmp_path / 'own').write_text(f'{own}\n')
    for name, text in files.items():
        (tmp_path / 'all' / name).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / 'all' / name).write_text(f'{text}\n')
    assert cgroup_quota(tmp_path / 'own', tmp_path / 'all') == quota


@pytest.mark.skipif(not hasattr(os, 'sched_getaffinity'), reason='no affinity on this system')
@pytest.mark.parametrize(('affinity', 'quota', 'n'), [
    ({0}, math.inf, 1), ({0, 3, 5}, math.inf, 3), ({0, 3, 5}, 1.5, 2), ({0}, 0.2, 1),
])
def test_affinity_and_quota(affinity, quota, n, monkeypatch):
    if sys.version_info >= (3, 13):
        monkeypatch.setattr(os, 'process_cpu_count', lambda: len(affinity))
    monkeypatch.setattr(os, 'sched_getaffinity', lambda pid: affinity)
    monkeypatch.setattr(processors, 'cgroup_quota', lambda: quota)
    assert available_processors() == n
