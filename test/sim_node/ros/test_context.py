"""ROS starts without a usable home, and makes no folder there."""

import os
from pathlib import Path

import pytest

pytest.importorskip('rclpy')

from sim_node.ros import context

ARGUMENTS = ['node', '--ros-args', '-p', 'x:=1']


@pytest.fixture
def started(monkeypatch):
    """Return a function that returns the arguments with which ROS is initialised."""
    given = []
    monkeypatch.setattr(context.rclpy, 'init', lambda args, **options: given.append(args))
    for name in ('ROS_LOG_DIR', 'ROS_HOME'):
        monkeypatch.delenv(name, raising=False)

    def start(**environment: str) -> list[str]:
        for name, value in environment.items():
            monkeypatch.setenv(name, value)
        context.start_ros(ARGUMENTS)
        return given[-1]

    return start


@pytest.mark.parametrize('home', ['', '~', 'relative', '/nowhere', '/proc', '/dev/null'])
def test_without_a_usable_home_there_are_no_log_files(started, monkeypatch, home):
    without = [*ARGUMENTS, '--ros-args', '--disable-external-lib-logs']
    if home == '/proc':  # nobody can make a folder there, root included
        monkeypatch.setattr(os, 'access', lambda path, mode: False)
    assert started(HOME=home) == without
    monkeypatch.delenv('HOME')
    assert started() == without
    assert started(ROS_LOG_DIR='/tmp/logs') == ARGUMENTS  # the user's own setting


def test_with_a_home_there_are_log_files(started, tmp_path: Path):
    assert started(HOME=str(tmp_path)) == ARGUMENTS
    assert list(tmp_path.iterdir()) == []
    (tmp_path / '.ros').write_text('a file')
    assert started(HOME=str(tmp_path)) != ARGUMENTS


def test_ros_starts_without_a_home(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('HOME', '~')
    for name in ('ROS_LOG_DIR', 'ROS_HOME'):
        monkeypatch.delenv(name, raising=False)
    context.start_ros(['node'])
    context.rclpy.shutdown()
    assert list(tmp_path.iterdir()) == []
