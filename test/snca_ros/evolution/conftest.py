"""Runs of `snca evolve`: one that was not stopped, and ways to start others."""

import os
import shutil
import signal
import subprocess
from pathlib import Path

import pytest
from support.evolve import EVALUATIONS, TASK, Here, command, environment, evolve
from support.limits import LIMIT


@pytest.fixture(scope='module', autouse=True)
def _children_hear_interrupts():
    """A shell without job control starts its background jobs, pytest too, with SIGINT ignored."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


@pytest.fixture
def start(tmp_path):
    """Return a function that starts the command in a process group of its own."""
    processes = []

    def start_one(*arguments: object) -> subprocess.Popen:
        process = subprocess.Popen(
            command(*arguments), cwd=tmp_path, env=environment(), text=True,
            stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True,
        )
        processes.append(process)
        return process

    yield start_one
    for process in processes:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
        process.communicate(timeout=LIMIT)


@pytest.fixture(scope='session')
def whole(tmp_path_factory) -> Path:
    """Return the folder of a run that nobody stopped, one worker."""
    folder = tmp_path_factory.mktemp('whole') / 'a' / 'run'
    run = evolve(*TASK, '--episodes', EVALUATIONS, '--workers', 1, '--run', folder)
    assert run.returncode == 0, run.stderr
    assert str(folder / 'best.npz') in run.stdout
    assert 'Traceback' not in run.stderr
    return folder


@pytest.fixture
def begun(whole, tmp_path) -> Path:
    """Return a copy of the folder of the whole run."""
    shutil.copytree(whole, tmp_path / 'begun')
    return tmp_path / 'begun'


@pytest.fixture
def here(tmp_path_factory, capsys, monkeypatch):
    folder = tmp_path_factory.mktemp('here')
    monkeypatch.chdir(folder)
    before = signal.getsignal(signal.SIGTERM)
    yield Here(folder, capsys)
    signal.signal(signal.SIGTERM, before)
