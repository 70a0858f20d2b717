"""Campaigns: whole, killed and resumed, with failures; the table is the same bytes."""

import csv
import os
import shutil
import signal
import subprocess
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.limits import LIMIT
from support.processes import wait_until
from support.tiny_campaign import (
    TINY,
    contents,
    generations,
    perform_or_die,
    start,
    work,
    write_file,
)

from sim_node.errors import InvalidInput
from sim_node.model.solver import Solver
from sim_node.model.terrain import UNSEEN_KINDS, UNSEEN_TERRAINS
from snca_ros import cli
from snca_ros.assessment.trials import Trial, score
from snca_ros.campaign.columns import COLUMNS, FORMER_COLUMNS, MAY_BE_EMPTY, settings_of
from snca_ros.campaign.endpoints import perform
from snca_ros.campaign.results import Results, read_curve, read_rows
from snca_ros.campaign.specification import read_campaign
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import load_controller
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evaluator import Evaluator
from snca_ros.evolution.workers import local_workers
from snca_ros.versions import package_versions


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
        *(f'controllers/{name}-robust.npz' for name in configs),
    }
    for name, row in rows.items():
        config = configs[name]
        assert tuple(row) == COLUMNS
        assert {key: row[key] for key in settings_of(config)} == settings_of(config)
        assert (row['seed'], row['episodes'], row['duration']) == (str(config.seed), '40', '1')
        assert (row['strategy'], row['physics'], row['as_printed']) == ('es', 'reference', 'false')
        assert row['terrain_set'] == 'seeds-1-12'
        versions = package_versions()
        for package in ('code', 'numpy', 'numba', 'pymunk'):
            assert row[f'{package}_version'] == versions[package]
        for what, suffix in (('best', ''), ('robust', '-robust')):
            made = whole / 'runs' / name / f'{what}.npz'
            kept = whole / 'results' / 'controllers' / f'{name}{suffix}.npz'
            assert kept.read_bytes() == made.read_bytes()


def test_every_setting_of_a_run_has_a_column():
    settings = {f.name for of in (RunConfig, Architecture, Solver) for f in fields(of)}
    settings = {'evolution_starts' if name == 'starts' else name for name in settings}
    # uniform and directional are the architecture's name; campaigns refuse the others.
    others = {'material', 'task', 'sensors', 'arithmetic'}
    assert settings - {*COLUMNS} == {'uniform', 'directional', 'solver', *others}


def speed(trial, **changes):
    return score(replace(trial, **changes)).score


def test_speeds_are_those_of_the_controller(file, whole):
    configs = {config.name: config for config in read_campaign(file)}
    for name, row in rows_of(whole).items():
        config = configs[name]
        best = load_controller(whole / 'results' / 'controllers' / f'{name}.npz')
        trial = Trial(best, 'flat', duration=1.0, transient=0.2)
        assert row['chosen_by'] == best.chosen_by == config.engine
        assert float(row['v_x_end']) == best.fitness == speed(trial, engine=config.engine)
        assert float(row['v_x_other']) == speed(trial, engine=config.other_engine)
        history = (whole / 'runs' / name / 'history.csv').read_text().splitlines()
        assert row['v_x_end'] == history[-1].split(',')[-1]
        unseen = [float(row[kind]) for kind in UNSEEN_KINDS]
        assert unseen[3] == speed(trial, terrain=UNSEEN_TERRAINS[3])
        assert float(row['v_x_unseen']) == pytest.approx(np.mean(unseen))
        pushed = [speed(trial, start=i) for i in range(1, 21)]
        assert row['starts'] == '1-20'
        assert float(row['v_x_pushed_mean']) == np.mean(pushed)
        assert float(row['v_x_pushed_std']) == pytest.approx(np.std(pushed, ddof=1))
        assert 0.0 < float(row['frequency']) <= 30.0
        assert 0.0 <= float(row['vibration']) <= 1.0


def test_robust_controller_has_the_best_mean_of_the_last_whole_population(file, whole):
    configs = {config.name: config for config in read_campaign(file)}
    for name, row in rows_of(whole).items():
        config = configs[name]
        folder = RunFolder.resume(whole / 'runs' / name)
        individuals, fitness = folder.load().population
        folder.close()
        assert len(individuals) == 8
        evaluator = Evaluator(config)
        means = np.mean([
            [one.score for one in evaluator(individuals, config.conditions(start))]
                for start in range(1, 21)
        ], axis=0)
        place = int(row['robust_rank']) - 1
        assert means[place] == means.max() == float(row['v_x_robust_chosen'])
        robust = load_controller(whole / 'results' / 'controllers' / f'{name}-robust.npz')
        assert robust.parameters.tolist() == individuals[place].tolist()
        assert robust.fitness == fitness[place] == robust.scores[config.engine]
        trial = Trial(robust, 'flat', duration=1.0, transient=0.2)
        pushed = [speed(trial, start=i) for i in range(101, 121)]
        assert row['robust_starts'] == '101-120'
        assert float(row['v_x_robust_mean']) == np.mean(pushed)
        assert float(row['v_x_robust_std']) == pytest.approx(np.std(pushed, ddof=1))
        unseen = [speed(trial, terrain=terrain) for terrain in UNSEEN_TERRAINS]
        assert float(row['v_x_robust_unseen']) == np.mean(unseen)


def test_only_what_an_engine_cannot_do_is_empty(whole, tmp_path):
    for row in rows_of(whole).values():
        assert [column for column, value in row.items() if not value] == []
    config = RunConfig(
        'worm-2x1', Architecture.named('U-D', 'mlp'), episodes=4, population=4, duration=0.5,
        transient=0.1, solver=Solver(self_collision=True),
    )
    row = perform(config, tmp_path / 'run').row
    assert [column for column, value in row.items() if not value] == ['v_x_other']
    assert 'v_x_other' in MAY_BE_EMPTY
    assert row['self_collision'] == 'true'


def test_a_run_on_drawn_sets_has_a_row_and_a_curve_that_may_fall(tmp_path):
    config = RunConfig.named(
        '11,11-10', 'U-D', 'mlp', terrain='flat,uphill-10', faults='none;loss=0..0.5', draw=2,
        episodes=64 + 16 * 4, population=8, duration=1.0, transient=0.2,
    )
    outcome = perform(config, tmp_path / 'run')
    row = outcome.row
    assert {key: row[key] for key in settings_of(config)} == settings_of(config)
    assert (row['shape'], row['faults'], row['evolution_starts'], row['draw'], row['score']) == (
        '11,11-10', 'none;loss=0..0.5', '0', '2', 'mean'
    )
    best = load_controller(tmp_path / 'run' / 'best.npz')
    assert (best.evaluations, best.n_episodes, best.morphology.name) == (128, 32, '11')
    assert float(row['v_x_end']) == best.fitness
    trial = Trial(best, 'flat', duration=1.0, transient=0.2)  # at home, without faults
    assert float(row['v_x_pushed_mean']) == np.mean([speed(trial, start=i) for i in range(1, 21)])
    robust = load_controller(tmp_path / 'run' / 'robust.npz')
    assert robust.n_episodes == 2
    results = Results(tmp_path / 'results')
    results.add(outcome)
    results.close()
    assert read_rows(tmp_path / 'results' / 'results.csv') == [row]
    curve = read_curve(tmp_path / 'results' / 'histories' / f'{row["run"]}.csv')
    assert curve[:, 0].tolist() == [16.0, 32.0, 48.0, 64.0]
    assert perform(config, tmp_path / 'run') == outcome


def test_tables_and_histories_of_earlier_versions_are_read(whole, tmp_path):
    shutil.copytree(whole / 'results', tmp_path / 'results')
    present = read_rows(whole / 'results' / 'results.csv')
    former = [[row[{'evaluations': 'episodes'}.get(name, name)] for name in FORMER_COLUMNS]
              for row in present]
    with (tmp_path / 'results' / 'results.csv').open('w', newline='') as file:
        csv.writer(file).writerows([FORMER_COLUMNS, *former])
    assert read_rows(tmp_path / 'results' / 'results.csv') == present
    for path in (tmp_path / 'results' / 'histories').iterdir():
        curve = read_curve(path)
        path.write_text(path.read_text().replace('episodes,', 'evaluations,'))
        np.testing.assert_array_equal(read_curve(path), curve)


def test_run_that_an_earlier_version_finished_is_refused(file, whole, tmp_path):
    config = read_campaign(file)[0]
    shutil.copytree(whole / 'runs' / config.name, tmp_path / 'run')
    path = tmp_path / 'run' / 'checkpoint.npz'
    with np.load(path) as data:
        kept = {name: data[name] for name in ('individuals', 'fitness', 'generation', 'history')}
    np.savez(path, **kept, reassessed=np.array([0.1, 0.2]))
    with pytest.raises(InvalidInput, match=r'run: .*earlier version.*remove the folder'):
        perform(config, tmp_path / 'run')


def test_history_is_the_best_so_far_where_it_rises(whole):
    for name in rows_of(whole):
        with (whole / 'runs' / name / 'history.csv').open(newline='') as full:
            points = [(int(r['episodes']), r['best_so_far']) for r in csv.DictReader(full)]
        with (whole / 'results' / 'histories' / f'{name}.csv').open(newline='') as thin:
            kept = [(int(r['episodes']), r['best_so_far']) for r in csv.DictReader(thin)]
        assert set(kept) <= set(points)
        assert (kept[0], kept[-1]) == (points[0], points[-1])
        curve = {}
        for episodes, best in points:  # the step function through the kept points
            curve[episodes] = [b for e, b in kept if e <= episodes][-1]
            assert curve[episodes] == best


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


@pytest.mark.slow
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
    assert 'repeat the command to continue' in err
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


def test_runs_that_end_their_process_fail_alone(file, whole, tmp_path, monkeypatch, capsys):
    names = [config.name for config in read_campaign(file)]
    deadly = names[1:3]
    monkeypatch.setattr('snca_ros.campaign.scheduler.perform', perform_or_die)
    monkeypatch.setenv('DEADLY', ' '.join(deadly))
    options = ['--results', str(tmp_path / 'results'), '--runs', str(tmp_path / 'runs')]
    assert cli.main(['campaign', str(file), '--workers', '4', *options]) == 1
    out, err = capsys.readouterr()
    assert '2 of 4 runs done, 0 running, 0 waiting, 2 failed' in out
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


def test_files_of_others_in_the_results_folder_are_kept(tmp_path):
    temporary = '.results.csv.snca-0123456789abcdef.tmp'
    others = ['.notes.tmp', '.results.csv.ab12cd.tmp', 'mail/.draft.tmp', f'other/{temporary}',
              'histories/.a.csv.ab12cd.tmp', f'controllers/{temporary}']
    own = [temporary, 'histories/.a.csv.snca-0123456789abcdef.tmp',
           'controllers/.a-robust.npz.snca-0123456789abcdef.tmp']
    for name in (*others, *own):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text('text')
    (tmp_path / '.lock').write_text('of others')
    Results(tmp_path).close()
    assert contents(tmp_path).keys() == {*others}
    assert (tmp_path / '.lock').read_text() == 'of others'


def test_scheduler_that_does_not_answer_leaves_nothing_behind(file, tmp_path, monkeypatch, capsys):
    pytest.importorskip('distributed')
    monkeypatch.setattr('snca_ros.evolution.workers._ANSWER_LIMIT', 0.2)
    monkeypatch.chdir(tmp_path)
    for command in (['campaign', str(file)], ['evolve', '--shape', 'worm']):
        for address in ('junk', '', 'tcp://127.0.0.1:1'):
            assert cli.main([*command, '--scheduler', address]) == 2
            err = capsys.readouterr().err
            assert f'scheduler: got {address!r}, expected the address of a Dask' in err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ('damage', 'words'),
    [
        (lambda text: text.replace('v_x_unseen', 'v_x_seen'), ['header']),
        (lambda text: text[: len(text) // 2], ['results.csv:']),
        (lambda text: text + text.splitlines()[1] + '\n', ['run', 'one row per run']),
        (lambda text: text.replace(',40,0,', ',40,zero,', 1), ['seed', "'zero'", 'a whole']),
        (lambda text: text.replace(',40,0,', ',40.5,0,', 1), ['episodes', "'40.5'"]),
        (lambda text: text.replace(',1-20,', ',1-20,x', 1), ['v_x_pushed_mean', 'a number']),
        (lambda text: text.replace(',101-120,', ',101-120,x', 1), ['v_x_robust_mean', 'a number']),
        (lambda text: text.replace(',1-20,', ',1-20,,', 1), ['values']),
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
