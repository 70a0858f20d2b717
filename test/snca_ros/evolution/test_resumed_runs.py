"""Runs that are interrupted or killed go on as if never stopped, and leave no process."""

import os
import shutil
import signal
import subprocess
from pathlib import Path

import pytest
import yaml
from support.evolve import (
    EVALUATIONS,
    TASK,
    VISIBLE,
    arrays_of,
    assert_same_run,
    contents_of,
    evaluations_in,
    evolve,
    freeze_midway,
    history_of,
)
from support.limits import LIMIT
from support.processes import is_alive, offspring, wait_until_gone

from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig


def assert_stopped(process: subprocess.Popen, folder: Path, workers: dict[int, str]) -> None:
    _, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 130
    assert 'Traceback' not in err
    assert err.splitlines()[-1] == f'stopped; continue with: snca evolve --resume {folder}'
    wait_until_gone(workers)
    assert sorted(p.name for p in folder.iterdir() if p.name != '.lock') == VISIBLE


def test_interrupted_run_goes_on_as_if_never_stopped(whole, tmp_path, start):
    folder = tmp_path / 'run'
    process = start(*TASK, '--episodes', EVALUATIONS, '--workers', 2, '--run', folder)
    done = freeze_midway(process, folder)
    workers = offspring(process.pid)
    os.killpg(process.pid, signal.SIGINT)  # a terminal's Ctrl-C tells the whole group
    process.send_signal(signal.SIGCONT)
    assert_stopped(process, folder, workers)

    assert done <= evaluations_in(folder) < EVALUATIONS
    assert arrays_of(folder / 'checkpoint.npz')['history'][-1, 1] == evaluations_in(folder)
    run = evolve('--resume', folder, '--workers', 1)
    assert run.returncode == 0, run.stderr
    assert_same_run(whole, folder)


def test_running_run_is_refused_to_others_and_stops_at_sigterm(tmp_path, start, here):
    folder = tmp_path / 'run'
    process = start(*TASK, '--episodes', EVALUATIONS, '--workers', 1, '--run', folder)
    freeze_midway(process, folder)
    workers, before = offspring(process.pid), contents_of(folder)
    here.refuses('--resume', folder, words=[str(folder), 'no other process'])
    here.refuses(*TASK, '--run', folder, words=[str(folder), '--resume'])
    assert contents_of(folder) == before
    process.send_signal(signal.SIGTERM)
    process.send_signal(signal.SIGCONT)
    assert_stopped(process, folder, workers)


def test_killed_run_leaves_no_process_and_goes_on_as_if_never_stopped(whole, tmp_path, start):
    folder = tmp_path / 'run'
    process = start(*TASK, '--episodes', EVALUATIONS, '--workers', 2, '--run', folder)
    done = freeze_midway(process, folder)
    workers = offspring(process.pid)
    assert len(workers) >= 2
    assert all(is_alive(pid, started) for pid, started in workers.items())
    process.kill()  # kill -9 of the parent alone
    assert process.wait(LIMIT) == -signal.SIGKILL
    wait_until_gone(workers)
    assert done == evaluations_in(folder)

    run = evolve('--resume', folder, '--workers', 1)
    assert run.returncode == 0, run.stderr
    assert_same_run(whole, folder)


def test_kill_before_the_first_generation(whole, tmp_path):
    # Only config.yaml and the lock are there.
    folder = tmp_path / 'run'
    folder.mkdir()
    shutil.copy(whole / 'config.yaml', folder)
    values = yaml.safe_load((folder / 'config.yaml').read_text())
    (folder / 'config.yaml').write_text(yaml.safe_dump({**values, 'episodes': 15}))
    run = evolve('--resume', folder, '--workers', 1)
    assert run.returncode == 0, run.stderr
    assert history_of(folder) == history_of(whole)[:2]


@pytest.mark.parametrize('lost', [['history.csv'], ['best.npz'], ['history.csv', 'best.npz']])
@pytest.mark.parametrize('how', ['older', 'missing', 'half'])
def test_kill_between_checkpoint_and_what_is_made_from_it(whole, begun, lost, how):
    for name in lost:
        path = begun / name
        if how == 'missing':
            path.unlink()
        elif how == 'half':
            path.write_bytes(path.read_bytes()[:100])
        else:
            path.write_bytes(b'generation,episodes,best,median,worst,best_so_far\n')
    folder = RunFolder.resume(begun)
    try:
        assert folder.load().episodes == EVALUATIONS
    finally:
        folder.close()
    assert_same_run(whole, begun)


def test_what_a_kill_left_half_written_is_cleared_away(begun):
    (begun / '.checkpoint.npz.snca-0123456789abcdef.tmp').write_bytes(b'PK\x03\x04 half of')
    (begun / '.checkpoint.npz.ab12cd.tmp').touch()  # of another program
    folder = RunFolder.resume(begun)
    try:
        folder.load()
    finally:
        folder.close()
    left = sorted(p.name for p in begun.iterdir() if p.name != '.lock')
    assert left == ['.checkpoint.npz.ab12cd.tmp', *VISIBLE]


def test_folder_of_a_run_killed_before_its_config_can_be_used_again(tmp_path):
    config = RunConfig('worm', Architecture.named('U-nD', 'snn-h'))
    (tmp_path / '.lock').touch()
    (tmp_path / '.config.yaml.snca-0123456789abcdef.tmp').write_text('shape: wo')
    RunFolder.create(tmp_path, config).close()
    assert RunConfig.from_yaml(tmp_path / 'config.yaml') == config


def test_resuming_a_finished_run_changes_nothing(begun, here):
    before = contents_of(begun)
    for workers in (1, 100):
        code, out, err = here.run('--resume', begun, '--workers', workers)
        assert (code, out.count('\n')) == (0, 1), err
        assert str(begun / 'best.npz') in out
    assert contents_of(begun) == before
