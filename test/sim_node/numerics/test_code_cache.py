"""The cache of compiled code: its dependence on sources, and damaged or missing files."""

import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

import sim_node
from sim_node.numerics.cache_folder import _check_mine, _parents, _unused
from sim_node.numerics.source_digest import sources


@pytest.fixture
def root(tmp_path: Path) -> Path:
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
def test_imports_of_compiled_code_change_the_digest(root: Path, name: str) -> None:
    before = sources(root)
    path = root / 'sim_node' / f'{name}.py'
    path.write_text(path.read_text() + '# changed\n')
    assert sources(root) != before


@pytest.mark.parametrize('name', ['node', 'text'])
def test_callers_of_compiled_code_do_not_change_the_digest(root: Path, name: str) -> None:
    before = sources(root)
    path = root / 'snca_ros' / f'{name}.py'
    path.write_text(path.read_text() + '# changed\n')
    assert sources(root) == before


def test_the_real_sources_include_kernels_and_their_constants() -> None:
    text = b'\n'.join(sources(Path(__file__).parents[3]))
    assert b'def advance_group' in text
    assert b'CONTROL_RATE = ' in text
    assert b'import rclpy' not in text


PROGRAM = """
import numpy as np
from sim_node.numerics import cache_folder
from sim_node.numerics.jit import compiled, warm_up
from sim_node.numerics.elementary_functions import tanh

@compiled
def twice_tanh(x):
    return 2.0 * tanh(x)

warm_up('test', lambda: twice_tanh(0.5))
print(repr(float(twice_tanh(0.5))), cache_folder.folder(), dict(twice_tanh.stats.cache_hits) != {})
"""


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """Return a folder with a copy of the package `sim_node`, the program and a home folder."""
    shutil.copytree(Path(sim_node.__file__).parent, tmp_path / 'sim_node')
    (tmp_path / 'snca_ros').mkdir()
    (tmp_path / 'program.py').write_text(PROGRAM)
    (tmp_path / 'home').mkdir()
    return tmp_path


def run(copy: Path, **environment: str) -> tuple[float, str, bool, str]:
    """Return the program's result, its cache folder, whether the cache had the code, and stderr."""
    kept = {k: v for k, v in os.environ.items() if k not in VARIABLES}
    program = subprocess.run(
        [sys.executable, 'program.py'], cwd=copy, text=True, capture_output=True, check=True,
        env={**kept, 'PYTHONPATH': str(copy), 'HOME': str(copy / 'home'), **environment},
    )
    number, folder, hit = program.stdout.split()
    return float(number), folder, hit == 'True', program.stderr


VARIABLES = ('HOME', 'XDG_CACHE_HOME', 'NUMBA_CACHE_DIR')


def test_cached_code_is_reused_until_a_function_that_it_calls_changes(copy: Path) -> None:
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


@pytest.mark.slow
def test_damaged_code_is_compiled_again(copy: Path) -> None:
    first, folder, *_ = run(copy)
    for pattern in ('*.nbc', '*.nbi'):
        for damage in (lambda data: data[: len(data) // 2], lambda data: b'\0' * len(data)):
            for path in Path(folder).rglob(pattern):
                path.write_bytes(damage(path.read_bytes()))
            *found, errors = run(copy)
            assert found == [first, folder, False]
            assert errors.count('\n') == errors.count('damaged: compiled code is dropped') == 1
            assert run(copy) == (first, folder, True, '')


def test_files_that_cannot_be_replaced_are_no_error(copy: Path) -> None:
    first, folder, *_ = run(copy)
    for path in [*Path(folder).rglob('*.nbi'), Path(folder) / 'test.compiled']:
        path.unlink()
        path.mkdir()
    (Path(folder) / 'test.compiled').rmdir()
    (Path(folder) / 'test.compiled').symlink_to('nowhere/file')
    *found, errors = run(copy)
    assert found == [first, folder, False]
    assert errors.count('\n') == errors.count('Is a directory: compiled code is not kept') == 1


def test_without_a_usable_home_code_is_kept_among_temporary_files(copy: Path) -> None:
    temporary = copy / 'tmp' / f'snca_ros-{os.getuid()}'
    temporary.parent.mkdir()
    (copy / 'home' / '.cache').write_text('')
    _, folder, hit, errors = run(copy, TMPDIR=str(temporary.parent))
    assert (Path(folder).parent, hit, errors) == (temporary, False, '')
    assert temporary.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize('home', ['~', '', 'relative', '/nowhere', '/dev/null'])
def test_home_that_is_no_folder_is_not_made(home, monkeypatch) -> None:
    for variable in VARIABLES[1:]:
        monkeypatch.delenv(variable, raising=False)
    monkeypatch.setenv('HOME', home)
    assert _parents() == [Path(tempfile.gettempdir(), f'snca_ros-{os.getuid()}')]


def test_a_link_in_the_place_of_the_folder_is_refused_and_not_followed(tmp_path: Path) -> None:
    (tmp_path / 'mine').mkdir(mode=0o755)
    (tmp_path / 'link').symlink_to('mine')
    with pytest.raises(PermissionError):
        _check_mine(tmp_path / 'link')
    assert (tmp_path / 'mine').stat().st_mode & 0o777 == 0o755


def test_without_any_folder_code_is_compiled_and_a_message_reports_it(copy: Path) -> None:
    (copy / 'file').write_text('')
    _, folder, hit, errors = run(copy, XDG_CACHE_HOME=str(copy / 'file'))
    assert (folder, hit) == ('None', False)
    assert errors.count('\n') == errors.count('Not a directory: compiled code cannot be kept') == 1


def test_folders_unused_for_a_month_are_removed(tmp_path: Path) -> None:
    old, used, other = (tmp_path / name for name in ('0' * 16, '1' * 16, 'another folder'))
    long_ago = time.time() - 31 * 86_400.0
    for path in (old, used, other):
        path.mkdir()
        os.utime(path, (long_ago, long_ago))
    (used / 'used').touch()
    os.utime(used, (long_ago, long_ago))
    assert list(_unused(tmp_path)) == [old]
