"""New processes import the modules that this one would, and none of the working directory."""

import subprocess
import sys
from concurrent.futures import wait

import pytest
from support.limits import LIMIT
from support.paths import ROOT

import snca_ros
from snca_ros.evolution.workers import local_workers
from snca_ros.graph.child_process import own_command


@pytest.fixture
def taken(tmp_path, monkeypatch):
    """Make a working directory with modules of the standard library's names; return a mark.

    The mark exists as soon as one of them is imported.
    """
    mark = tmp_path / 'taken'
    for name in ('random', 'socket', 'yaml', 'selectors', 'tempfile'):
        (tmp_path / f'{name}.py').write_text(f'open({str(mark)!r}, "w"); raise SystemExit(3)')
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr('sys.path', [str(ROOT), *(p for p in sys.path if p)])
    return mark


def test_a_node_imports_nothing_from_the_working_directory(taken):
    run = subprocess.run(
        own_command('snca_ros', 'completion', 'bash', '--help'), capture_output=True, text=True,
        timeout=LIMIT, check=False,
    )
    assert (run.returncode, run.stderr) == (0, '')
    assert 'usage: snca completion' in run.stdout
    assert not taken.exists()


@pytest.mark.skipif(sys.version_info < (3, 11), reason='Python 3.10 has no safe path')
def test_a_worker_imports_nothing_from_the_working_directory(taken):
    with local_workers(1) as workers:
        (done,), _ = wait([workers.executor.submit(len, 'four')])
        assert done.result() == 4
    assert not taken.exists()
    assert snca_ros.__file__.startswith(str(ROOT))
