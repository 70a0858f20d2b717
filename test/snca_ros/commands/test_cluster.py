"""A Dask scheduler and its workers, processes of their own, one of them killed on the way."""

import json
import os
import signal
import subprocess
import sys
import threading
from concurrent.futures import BrokenExecutor

import numpy as np
import pytest
from support.limits import LIMIT
from support.processes import wait_until
from support.tiny_campaign import (
    ROOT,
    contents,
    generations,
    start,
    work,
    write_file,
)

from snca_ros import cli
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evaluator import evaluate
from snca_ros.evolution.workers import IN_PROCESS, cluster_workers

pytest.importorskip('distributed')


@pytest.fixture
def dask(tmp_path):
    """Return a function that starts a Dask process with these arguments."""
    processes = []

    def start_one(*arguments: str) -> subprocess.Popen:
        process = subprocess.Popen(
            [sys.executable, '-m', 'dask', *arguments, '--no-dashboard',
             '--scheduler-file', str(tmp_path / 'scheduler.json')],
            env={**os.environ, 'PYTHONPATH': str(ROOT)}, cwd=tmp_path,
            stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        )
        processes.append(process)
        return process

    start_one.processes = processes
    yield start_one
    for process in processes:
        process.kill()
        process.wait(LIMIT)


@pytest.fixture
def scheduler(dask, tmp_path):
    """Return the address of a scheduler on the loopback interface."""
    dask('scheduler', '--host', '127.0.0.1', '--port', '0')
    file = tmp_path / 'scheduler.json'
    wait_until(lambda: file.exists() and file.read_text().endswith('}'), 'the scheduler')
    return json.loads(file.read_text())['address']


@pytest.fixture
def workers(dask, scheduler):
    """Return two workers of that scheduler that keep their process to themselves."""
    from distributed import Client

    two = [dask('worker', '--nworkers', '1', '--nthreads', '1', '--no-nanny') for _ in range(2)]
    with Client(scheduler) as client:
        client.wait_for_workers(2, timeout=LIMIT)
    return two


@pytest.mark.slow
def test_campaign_on_a_cluster_that_loses_a_worker(workers, scheduler, tmp_path):
    file, whole, folder = write_file(tmp_path), tmp_path / 'whole', tmp_path / 'cluster'
    work(file, whole)
    process = start(file, folder, '--scheduler', scheduler)
    try:
        wait_until(lambda: generations(folder) >= 3, 'three generations')
        workers[0].kill()
        out, err = process.communicate(timeout=LIMIT)
    finally:
        process.kill()
    assert process.returncode == 0, err
    assert '4 of 4 runs done, 0 running, 0 waiting, 0 failed' in out
    assert workers[0].wait(LIMIT) == -signal.SIGKILL
    assert contents(folder / 'results') == contents(whole / 'results')


@pytest.mark.usefixtures('workers')
def test_campaign_on_a_cluster_that_is_lost_says_how_to_go_on(
    dask, scheduler, tmp_path, monkeypatch, capsys
):
    monkeypatch.setattr('snca_ros.evolution.workers._ANSWER_LIMIT', 2.0)
    monkeypatch.setenv('DASK_DISTRIBUTED__COMM__TIMEOUTS__CONNECT', '2s')
    file, folder = write_file(tmp_path), tmp_path / 'cluster'
    options = ['--results', str(folder / 'results'), '--runs', str(folder / 'runs')]

    def lose_it() -> None:
        wait_until(lambda: generations(folder) >= 1, 'a generation')
        dask.processes[0].kill()

    loser = threading.Thread(target=lose_it)
    loser.start()
    before = signal.getsignal(signal.SIGTERM)
    try:
        assert cli.main(['campaign', str(file), '--scheduler', scheduler, *options]) == 2
    finally:
        signal.signal(signal.SIGTERM, before)
        loser.join(LIMIT)
    err = capsys.readouterr().err
    assert 'repeat the command to continue: 0 of 4 runs done' in err
    assert '4 waiting, 0 failed' in err
    assert 'the address of a Dask scheduler' in err.splitlines()[-1]


def test_evolution_on_a_cluster_that_loses_a_worker(workers, scheduler, tmp_path):
    task = ['--shape', 'worm-3x1', '--duration', '1', '--transient', '0.2', '--population', '8',
            '--episodes', '40']
    there, here = tmp_path / 'there', tmp_path / 'here'
    assert cli.main(['evolve', *task, '--run', str(there), '--scheduler', scheduler]) == 0
    assert cli.main(['evolve', *task, '--run', str(here), '--workers', '1']) == 0
    for name in ('history.csv', 'best.npz', 'checkpoint.npz'):
        assert (there / name).read_bytes() == (here / name).read_bytes()

    config = RunConfig('worm-3x1', Architecture.named('U-nD', 'snn-h'), duration=5.0, transient=0.0)
    thetas = np.random.default_rng(0).uniform(-1.0, 1.0, (24, config.n_parameters))
    alone = list(evaluate(IN_PROCESS, config, thetas))
    with cluster_workers(scheduler) as cluster:
        assert cluster.count() == 2
        scores = evaluate(cluster, config, thetas)
        first = next(scores)
        workers[1].kill()
        assert [first, *scores] == alone
        wait_until(lambda: cluster.count() == 1, 'the scheduler to notice')
    assert len(set(alone)) > 20


@pytest.fixture
def _wary(monkeypatch):
    """Let schedulers give a task up at the first death of a worker, not at the fourth."""
    monkeypatch.setenv('DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES', '0')


@pytest.mark.usefixtures('_wary', 'workers')
def test_task_that_ends_its_workers_is_told(scheduler):
    with pytest.raises(BrokenExecutor, match=scheduler), cluster_workers(scheduler) as cluster:
        cluster.executor.submit(os._exit, 3).result(60.0)


@pytest.mark.parametrize('address', ['nowhere', 'tcp://127.0.0.1:1', 'xyz://127.0.0.1:1'])
def test_address_of_no_scheduler_is_one_line(address, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr('snca_ros.evolution.workers._ANSWER_LIMIT', 0.5)
    code = cli.main(['evolve', '--run', str(tmp_path / 'run'), '--scheduler', address])
    lines = capsys.readouterr().err.splitlines()
    assert code == 2
    assert address in lines[-1]
    assert 'Dask scheduler' in lines[-1]
