"""Campaigns: whole, killed and resumed, with failures; the table is the same bytes."""

import csv
import os
import shutil
import signal
import subprocess
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from tiny_campaign import (
    LIMIT,
    TINY,
    contents,
    generations,
    start,
    wait_until,
    work,
    write_file,
)

from sim_node.errors import InvalidInput
from sim_node.terrain import UNSEEN_TERRAINS
from snca_ros import cli
from snca_ros.controller_file import load_controller
from snca_ros.evolution.workers import local_workers
from snca_ros.study.assess import Trial, score
from snca_ros.study.campaign_file import read_campaign
from snca_ros.study.results import COLUMNS, STARTS, Results, perform, read_rows


@pytest.fixture(scope='module')
def file(tmp_path_factory):
    return write_file(tmp_path_factory.mktemp('campaign'))


@pytest.fixture(autouse=True)
def _signals_are_restored():
    before = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, before)


@pytest.fixture(scope='module')
def whole(file, tmp_path_factory):
    """Return the folder of a campaign that nobody stopped."""
    folder = tmp_path_factory.mktemp('whole')
    campaign = work(file, folder)
    assert not campaign.failed
    return folder


def rows_of(folder: Path) -> dict[str, dict[str, str]]:
    with (folder / 'results' / 'results.csv').open(newline='') as table:
        return {row['run']: row for row in csv.DictReader(table)}


# --- the results ------------------------------------------------------------------------------


def test_every_run_has_its_row_history_and_controller(file, whole):
    configs = {config.name: config for config in read_campaign(file)}
    rows = rows_of(whole)
    assert rows.keys() == configs.keys()
    assert contents(whole / 'results').keys() == {
        'results.csv',
        *(f'histories/{name}.csv' for name in configs),
        *(f'controllers/{name}.npz' for name in configs),
    }
    for name, row in rows.items():
        config = configs[name]
        assert tuple(row) == COLUMNS
        told = row['shape'], row['architecture'], row['neuron_model'], row['engine']
        cell = config.architecture
        assert told == (config.shape, cell.name, cell.neuron_model, config.engine)
        assert (row['seed'], row['n_evaluations']) == (str(config.seed), '40')
        assert row['as_printed'] == 'false'
        best = whole / 'runs' / name / 'best.npz'
        kept = whole / 'results' / 'controllers' / f'{name}.npz'
        assert kept.read_bytes() == best.read_bytes()


def test_speeds_are_those_of_the_controller(file, whole):
    configs = {config.name: config for config in read_campaign(file)}
    for name, row in rows_of(whole).items():
        config = configs[name]
        best = load_controller(whole / 'results' / 'controllers' / f'{name}.npz')
        trial = Trial(best, 'flat', duration=1.0, transient=0.2)
        assert float(row['v_x']) == best.fitness == best.v_x[row['chosen_by']]
        assert float(row[f'v_x_{config.engine}']) == best.v_x[config.engine]
        assert float(row['v_x_pymunk']) == score(trial)
        assert float(row['v_x_batched']) == score(replace(trial, engine='batched'))
        unseen = [float(row[terrain]) for terrain in UNSEEN_TERRAINS]
        assert unseen[3] == score(replace(trial, terrain=UNSEEN_TERRAINS[3]))
        assert float(row['v_x_unseen']) == pytest.approx(np.mean(unseen))
        pushed = [score(replace(trial, start=1 + i)) for i in range(STARTS)]
        assert row['starts'] == str(STARTS)
        assert float(row['v_x_starts_mean']) == np.mean(pushed)
        assert float(row['v_x_starts_std']) == pytest.approx(np.std(pushed, ddof=1))
        assert 0.0 < float(row['frequency']) <= 30.0


def test_history_is_the_best_so_far_where_it_rises(whole):
    for name in rows_of(whole):
        with (whole / 'runs' / name / 'history.csv').open(newline='') as full:
            points = [(int(r['evaluations']), r['best_so_far']) for r in csv.DictReader(full)]
        with (whole / 'results' / 'histories' / f'{name}.csv').open(newline='') as thin:
            kept = [(int(r['evaluations']), r['best_so_far']) for r in csv.DictReader(thin)]
        assert set(kept) <= set(points)
        assert (kept[0], kept[-1]) == (points[0], points[-1])
        curve = {}
        for evaluations, best in points:  # the step function through the kept points
            curve[evaluations] = [b for e, b in kept if e <= evaluations][-1]
            assert curve[evaluations] == best


def test_workers_do_not_matter(file, whole, tmp_path):
    with local_workers(2) as workers:
        work(file, tmp_path, workers)
    assert contents(tmp_path / 'results') == contents(whole / 'results')


def test_finished_runs_are_not_done_again_and_shared_between_campaigns(file, whole, tmp_path):
    shutil.copytree(whole / 'results', tmp_path / 'results')
    more = tmp_path / 'more.yaml'
    more.write_text(yaml.safe_dump({**TINY, 'seed': [1, 2], 'cases': [{'architecture': 'U-D'}]}))
    campaign = work(more, tmp_path)
    assert [path.name for path in (tmp_path / 'runs').iterdir()] == [
        config.name for config in campaign.configs if config.seed == 2
    ]
    before, after = rows_of(whole), rows_of(tmp_path)
    assert len(after) == 5
    assert {name: after[name] for name in before} == before
    # In another results folder the run folders are taken up: assessed, not evolved again.
    folder = tmp_path / 'other'
    shutil.copytree(whole / 'runs', folder / 'runs')
    stamps = {p: p.stat().st_mtime_ns for p in (folder / 'runs').rglob('checkpoint.npz')}
    work(file, folder)
    assert contents(folder / 'results') == contents(whole / 'results')
    assert stamps == {p: p.stat().st_mtime_ns for p in (folder / 'runs').rglob('checkpoint.npz')}


# --- stopped, killed, failing -----------------------------------------------------------------


def test_killed_twice_and_resumed_gives_the_same_bytes(file, whole, tmp_path):
    for _ in range(2):
        before = generations(tmp_path)
        process = start(file, tmp_path)
        try:
            wait_until(lambda: generations(tmp_path) >= before + 2, 'two generations')  # noqa: B023
        finally:
            process.kill()
            process.communicate(timeout=LIMIT)
    process = start(file, tmp_path)
    out, err = process.communicate(timeout=LIMIT)
    assert process.returncode == 0, err
    assert '4 of 4 runs done, 0 running, 0 waiting, 0 failed' in out
    assert contents(tmp_path / 'results') == contents(whole / 'results')


def test_sigterm_stops_and_says_how_to_go_on(file, whole, tmp_path):
    process = start(file, tmp_path)
    wait_until(lambda: generations(tmp_path) >= 1, 'a generation')
    process.send_signal(signal.SIGTERM)
    _, err = process.communicate(timeout=LIMIT)  # also: no worker holds the pipes open
    assert process.returncode == 130
    assert 'Traceback' not in err
    assert 'the same command goes on' in err
    work(file, tmp_path)
    assert contents(tmp_path / 'results') == contents(whole / 'results')


def workers_of(process: subprocess.Popen) -> list[int]:
    children = Path(f'/proc/{process.pid}/task/{process.pid}/children').read_text().split()
    return [int(c) for c in children if b'spawn_main' in Path(f'/proc/{c}/cmdline').read_bytes()]


def test_worker_that_is_killed_is_replaced(file, whole, tmp_path):
    process = start(file, tmp_path)
    wait_until(lambda: generations(tmp_path) >= 1, 'a generation')
    workers = workers_of(process)
    os.kill(workers[0], signal.SIGKILL)
    out, err = process.communicate(timeout=LIMIT)
    assert (process.returncode, len(workers)) == (0, 2), err
    assert '4 of 4 runs done' in out
    assert contents(tmp_path / 'results') == contents(whole / 'results')


def test_failed_run_is_reported_and_the_rest_goes_on(file, whole, tmp_path, capsys):
    bad = read_campaign(file)[0].name
    shutil.copytree(whole / 'runs' / bad, tmp_path / 'runs' / bad)
    (tmp_path / 'runs' / bad / 'checkpoint.npz').write_bytes(b'damaged')
    options = ['--results', str(tmp_path / 'results'), '--runs', str(tmp_path / 'runs')]
    assert cli.main(['campaign', str(file), '--workers', '1', *options]) == 1
    out, err = capsys.readouterr()
    assert '3 of 4 runs done, 0 running, 0 waiting, 1 failed' in out
    assert f'{bad} failed: InvalidInput: ' in err
    assert 'checkpoint.npz' in err
    assert rows_of(tmp_path).keys() == rows_of(whole).keys() - {bad}
    shutil.rmtree(tmp_path / 'runs' / bad)
    work(file, tmp_path)
    assert contents(tmp_path / 'results') == contents(whole / 'results')


def _perform_or_die(config, path):
    if config.name in os.environ['DEADLY'].split():
        os._exit(3)
    return perform(config, path)


@pytest.mark.parametrize('n_deadly', [1, 2])
def test_runs_that_end_their_process_fail_alone(
    n_deadly, file, whole, tmp_path, monkeypatch, capsys
):
    names = [config.name for config in read_campaign(file)]
    deadly = names[1 : 1 + n_deadly]
    monkeypatch.setattr('snca_ros.study.campaign.perform', _perform_or_die)
    monkeypatch.setenv('DEADLY', ' '.join(deadly))
    options = ['--results', str(tmp_path / 'results'), '--runs', str(tmp_path / 'runs')]
    assert cli.main(['campaign', str(file), '--workers', '4', *options]) == 1
    out, err = capsys.readouterr()
    assert f'{4 - n_deadly} of 4 runs done, 0 running, 0 waiting, {n_deadly} failed' in out
    assert [line.split()[0] for line in err.splitlines() if ' failed: ' in line] == deadly
    assert rows_of(tmp_path).keys() == set(names) - set(deadly)
    monkeypatch.undo()
    work(file, tmp_path)
    assert contents(tmp_path / 'results') == contents(whole / 'results')


def test_folder_of_another_run_is_refused(file, whole, tmp_path):
    one, other, *_ = (config.name for config in read_campaign(file))
    shutil.copytree(whole / 'runs' / one, tmp_path / 'runs' / other)
    campaign = work(file, tmp_path)
    assert list(campaign.failed) == [other]
    assert f'the configuration of {other}' in campaign.failed[other]


def test_results_in_use_are_refused(file, tmp_path, capsys):
    held = Results(tmp_path)
    assert cli.main(['campaign', str(file), '--results', str(tmp_path)]) == 2
    held.close()
    err = capsys.readouterr().err
    assert err.count('\n') == 1
    assert 'no other process' in err


@pytest.mark.parametrize(
    ('damage', 'words'),
    [
        (lambda text: text.replace('v_x_unseen', 'v_x_seen'), ['header']),
        (lambda text: text[: len(text) // 2], ['results.csv:']),
        (lambda text: text + text.splitlines()[1] + '\n', ['run', 'no other row']),
        (lambda text: text.replace(',mlp,false,0,', ',mlp,false,zero,', 1), ['seed', "'zero'"]),
        (lambda text: text.replace(',20,', ',20,x', 1), ['v_x_starts_mean', 'a number']),
        (lambda text: '', ['file']),
        (lambda text: '\0', ['results.csv']),
    ],
)
def test_damaged_table_is_refused_and_kept(whole, tmp_path, damage, words):
    (tmp_path / 'results.csv').write_text(
        damage((whole / 'results' / 'results.csv').read_text())
    )
    before = (tmp_path / 'results.csv').read_bytes()
    with pytest.raises(InvalidInput) as error:
        Results(tmp_path)
    assert all(word in str(error.value) for word in words)
    assert (tmp_path / 'results.csv').read_bytes() == before


def test_rows_are_read_as_they_were_written(whole):
    rows = read_rows(whole / 'results' / 'results.csv')
    assert {row['run']: row for row in rows} == rows_of(whole)
    assert [row['seed'] for row in rows] == ['0', '1', '0', '1']
