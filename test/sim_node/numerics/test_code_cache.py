"""Compiled code that is kept: by which sources it is named, and what happens if it is damaged."""

import os
import shutil
import subprocess
import sys
import time
from pathlib import Path

import pytest

import sim_node
from sim_node.numerics.code_cache import _unused, sources


@pytest.fixture
def house(tmp_path: Path) -> Path:
    files = {
        'sim_node/kernel.py': 'from sim_node.numerics.jit import (\n    compiled,\n)\n'
        'from sim_node.table import SIZE\n',
        'sim_node/table.py': 'from sim_node.digits import ONE\nSIZE = ONE\n',
        'sim_node/digits.py': 'ONE = 1\n',
        'snca_ros/node.py': (
            'from sim_node.numerics.jit import warm_up\nfrom snca_ros.text import A\n'
        ),
        'snca_ros/text.py': 'A = 1\n',
    }
    for name, text in files.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True)
        path.write_text(text)
    return tmp_path


@pytest.mark.parametrize('name', ['kernel', 'table', 'digits'])
def test_what_compiled_code_imports_counts(house: Path, name: str) -> None:
    before = sources(house)
    path = house / 'sim_node' / f'{name}.py'
    path.write_text(path.read_text() + '# changed\n')
    assert sources(house) != before


@pytest.mark.parametrize('name', ['node', 'text'])
def test_what_only_calls_compiled_code_does_not(house: Path, name: str) -> None:
    before = sources(house)
    path = house / 'snca_ros' / f'{name}.py'
    path.write_text(path.read_text() + '# changed\n')
    assert sources(house) == before


def test_the_real_sources_hold_kernels_and_their_constants() -> None:
    text = b'\n'.join(sources(Path(__file__).parents[3]))
    assert b'def advance_group' in text
    assert b'CONTROL_RATE = ' in text
    assert b'import rclpy' not in text


PROGRAM = """
import numpy as np
from sim_node.numerics import code_cache
from sim_node.numerics.jit import compiled, warm_up
from sim_node.numerics.elementary_functions import tanh

@compiled
def twice_tanh(x):
    return 2.0 * tanh(x)

warm_up('test', lambda: twice_tanh(0.5))
print(repr(float(twice_tanh(0.5))), code_cache.folder(), dict(twice_tanh.stats.cache_hits) != {})
"""


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Return a folder with the package `sim_node`, the program and an environment of its own."""
    shutil.copytree(Path(sim_node.__file__).parent, tmp_path / 'sim_node')
    (tmp_path / 'snca_ros').mkdir()
    (tmp_path / 'program.py').write_text(PROGRAM)
    (tmp_path / 'home').mkdir()
    return tmp_path


def run(copy: Path, **environment: str) -> tuple[float, str, bool, str]:
    """Return what the program prints: the number, its cache folder, whether it was used; errors."""
    kept = {k: v for k, v in os.environ.items() if k not in VARIABLES}
    program = subprocess.run(
        [sys.executable, 'program.py'], cwd=copy, text=True, capture_output=True, check=True,
        env={**kept, 'PYTHONPATH': str(copy), 'HOME': str(copy / 'home'), **environment},
    )
    number, folder, hit = program.stdout.split()
    return float(number), folder, hit == 'True', program.stderr


VARIABLES = ('HOME', 'XDG_CACHE_HOME', 'NUMBA_CACHE_DIR')


def test_code_is_kept_and_a_change_of_what_it_calls_never_meets_it(copy: Path) -> None:
    first, folder, hit, errors = run(copy)
    assert (hit, errors) == (False, '')
    assert Path(folder).parent == copy / 'home' / '.cache' / 'snca_ros'
    assert run(copy)[:3] == (first, folder, True)
    path = copy / 'sim_node' / 'numerics' / 'elementary_functions.py'
    old, new = 'def tanh(x):', 'def tanh(x):\n    return 3.0\n\n\ndef _old(x):'
    path.write_text(path.read_text().replace(old, new))
    for environment in ({}, {'NUMBA_CACHE_DIR': str(copy / 'numba')}):
        found, other, hit, _ = run(copy, **environment)
        assert (found, hit) == (6.0, False)
        assert other != folder
        assert run(copy, **environment)[0] == 6.0


def test_damaged_code_is_compiled_again(copy: Path) -> None:
    first, folder, *_ = run(copy)
    for pattern in ('*.nbc', '*.nbi'):
        for damage in (lambda data: data[: len(data) // 2], lambda data: b'\0' * len(data)):
            for path in Path(folder).rglob(pattern):
                path.write_bytes(damage(path.read_bytes()))
            assert run(copy)[:3] == (first, folder, False)
            assert run(copy)[:3] == (first, folder, True)


@pytest.mark.skipif(os.getuid() == 0, reason='root may write everywhere')
def test_where_nothing_can_be_kept_code_is_compiled_with_a_line_that_says_so(copy: Path) -> None:
    (copy / 'home').chmod(0o500)
    _, folder, hit, errors = run(copy)
    assert (folder, hit) == ('None', False)
    assert 'compiled code cannot be kept' in errors


def test_a_file_in_the_way_of_the_folder_is_no_end(copy: Path) -> None:
    (copy / 'home' / '.cache').write_text('')
    _, folder, hit, errors = run(copy)
    assert (folder, hit) == ('None', False)
    assert errors.count('compiled code cannot be kept') == 1


def test_folders_that_nobody_used_for_a_month_are_removed(tmp_path: Path) -> None:
    old, used, other = (tmp_path / name for name in ('0' * 16, '1' * 16, 'somebody else'))
    long_ago = time.time() - 31 * 86_400.0
    for path in (old, used, other):
        path.mkdir()
        os.utime(path, (long_ago, long_ago))
    (used / 'used').touch()
    os.utime(used, (long_ago, long_ago))
    assert list(_unused(tmp_path)) == [old]
