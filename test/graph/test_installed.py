"""A wheel that is installed into a prefix of its own: each executable starts, a robot walks."""

import os
import shutil
import subprocess
import sys

import pytest
from support.limits import LIMIT
from support.paths import ROOT

from snca_ros import cli

PARTS = (
    'config', 'launch', 'resource', 'scripts', 'sim_node', 'snca_ros', 'setup.py', 'setup.cfg',
    'pyproject.toml', 'package.xml', 'README.md', 'LICENSE',
)


@pytest.fixture(scope='module')
def installed(tmp_path_factory):
    """Return the prefix into which a wheel of this checkout is installed, and its environment."""
    pytest.importorskip('wheel')
    copy = tmp_path_factory.mktemp('checkout')
    for name in PARTS:
        path = ROOT / name
        if path.is_dir():
            shutil.copytree(path, copy / name, ignore=shutil.ignore_patterns('__pycache__'))
        elif path.exists():
            shutil.copy(path, copy)
    prefix = tmp_path_factory.mktemp('prefix')
    subprocess.run(
        [sys.executable, 'setup.py', '-q', 'bdist_wheel'], cwd=copy, check=True, capture_output=True
    )
    (wheel,) = (copy / 'dist').glob('*.whl')
    subprocess.run(
        [sys.executable, '-m', 'pip', 'install', '-q', '--disable-pip-version-check', '--no-deps',
         '--no-index', '--ignore-installed', '--prefix', prefix, wheel],
        check=True, capture_output=True,
    )
    (site,) = prefix.glob('**/site-packages')
    python = os.path.dirname(sys.executable)
    return prefix, {
        **os.environ, 'PYTHONPATH': str(site), 'PATH': f'{python}{os.pathsep}{os.environ["PATH"]}'
    }


def run(installed, name, *arguments, cwd):
    prefix, environment = installed
    return subprocess.run(
        [prefix / 'lib' / 'snca_ros' / name, *arguments], cwd=cwd, env=environment, timeout=LIMIT,
        capture_output=True, text=True, check=False,
    )


@pytest.mark.parametrize('name', [n for n in (*cli.COMMANDS, *cli.NODES) if n != 'completion'])
def test_each_executable_describes_itself(installed, tmp_path, name):
    result = run(installed, name, '--help', cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    assert 'usage: ' in result.stdout
    assert list(tmp_path.iterdir()) == []


def test_the_executables_run_the_installed_modules(installed, tmp_path):
    prefix, environment = installed
    code = 'import snca_ros, sim_node; print(snca_ros.__file__, sim_node.__file__)'
    result = subprocess.run(
        [sys.executable, '-c', code], cwd=tmp_path, env=environment, capture_output=True,
        text=True, check=True,
    )
    assert all(path.startswith(str(prefix)) for path in result.stdout.split())


def test_a_bundled_robot_walks_and_its_page_is_made(installed, tmp_path):
    result = run(
        installed, 'walk', 'biped-U-D-mlp', '--duration', '0.5', '--bag', 'bag', cwd=tmp_path
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert 'bit for bit the same' in result.stdout
    result = run(installed, 'replay', 'bag', cwd=tmp_path)
    assert result.returncode == 0, result.stdout + result.stderr
    pages = list(tmp_path.glob('**/*.html'))
    assert pages
    assert '<canvas' in pages[0].read_text()
