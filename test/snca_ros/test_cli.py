"""The `snca` command: overview, version, dispatch, and one line for a command that is none."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import snca_ros
from snca_ros import cli

ROOT = Path(snca_ros.__file__).parents[1]


def python_m_snca_ros(*arguments, **options):
    return subprocess.run(
        [sys.executable, '-m', 'snca_ros', *arguments],
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
        text=True, timeout=300, check=False, **options,
    )


@pytest.mark.parametrize('arguments', [[], ['-h'], ['--help']])
def test_help_names_every_command_and_node(arguments, capsys):
    assert cli.main(arguments) == 0
    out, err = capsys.readouterr()
    assert err == ''
    assert out.startswith('usage: snca COMMAND')
    listed = [line.split()[0] for line in out.splitlines() if line.startswith('  ')]
    assert listed == [*cli.COMMANDS, *cli.NODES]


def test_version(capsys):
    assert cli.main(['--version']) == 0
    assert capsys.readouterr().out == f'snca_ros {snca_ros.__version__}\n'


@pytest.mark.parametrize('name', sorted({**cli.COMMANDS, **cli.NODES}))
def test_every_command_has_a_module(name):
    module = {**cli.COMMANDS, **cli.NODES}[name][0]
    assert (ROOT / (module.replace('.', '/') + '.py')).is_file()


@pytest.mark.parametrize(
    ('typo', 'meant'),
    [
        ('evolv', 'evolve'),
        ('wlak', 'walk'),
        ('simnode', 'sim_node'),
        ('voxel-node', 'voxel_node'),
        ('Report', 'report'),
    ],
)
def test_near_miss_is_told(typo, meant, capsys):
    assert cli.main([typo, '--seed', '3']) == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert err.count('\n') == 1
    assert repr(typo) in err
    assert f"did you mean '{meant}'?" in err


@pytest.mark.parametrize('name', ['xyzzy', '', '--verzion', '-x', 'evolve '])
def test_unknown_command_is_one_line(name, capsys):
    assert cli.main([name]) == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert err.endswith('\n')
    for known in (*cli.COMMANDS, *cli.NODES):
        assert known in err
    assert err.count('\n') == 1


def test_help_of_evolve_names_its_options(capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(['evolve', '--help'])
    assert end.value.code == 0
    out = capsys.readouterr().out
    assert out.startswith('usage: snca evolve')
    wanted = 'shape architecture neuron-model terrain evaluations seed workers resume run'
    for option in wanted.split():
        assert f'--{option} ' in out


def test_ros_args_are_ignored_by_commands(capsys):
    with pytest.raises(SystemExit) as end:
        cli.main(['evolve', '--help', '--ros-args', '-r', '__ns:=/x'])
    assert end.value.code == 0
    # What stands behind --ros-args is no error, what stands before it is.
    assert cli.main(['evolve', '--shape', 'bipd', '--ros-args', '--nonsense']) == 2
    assert "did you mean 'biped'?" in capsys.readouterr().err


def test_as_a_process():
    run = python_m_snca_ros('--version', capture_output=True)
    assert (run.returncode, run.stdout, run.stderr) == (0, f'snca_ros {cli.__version__}\n', '')
    run = python_m_snca_ros('evolv', capture_output=True)
    assert (run.returncode, run.stdout, run.stderr.count('\n')) == (2, '', 1)
    assert "did you mean 'evolve'?" in run.stderr


@pytest.mark.parametrize('unbuffered', ['', '1'])
def test_reader_that_has_gone_gets_no_traceback(unbuffered, monkeypatch):
    monkeypatch.setenv('PYTHONUNBUFFERED', unbuffered)
    read, write = os.pipe()
    os.close(read)
    try:
        run = python_m_snca_ros('--help', stdout=write, stderr=subprocess.PIPE)
    finally:
        os.close(write)
    assert run.stderr == ''
