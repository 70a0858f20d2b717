"""The assess command: scores, table, CSV and figure of controllers on many grounds."""

import csv
from dataclasses import replace

import numpy as np
import pytest
from support.assessment import assess, trained_worm

from sim_node.model.terrain import UNSEEN_KINDS, UNSEEN_TERRAINS, unseen_terrains
from sim_node.simulation import Simulation
from snca_ros.assessment.running import groups_of, run_trials
from snca_ros.assessment.trials import COLUMNS, Trial, score, summary, table
from snca_ros.bundled import DEFAULT_CONTROLLER, find_controller
from snca_ros.controller_file import load_controller
from snca_ros.evolution.episode import run_episode
from snca_ros.evolution.workers import IN_PROCESS, local_workers
from snca_ros.faults import parse_faults


@pytest.mark.parametrize('engine', ['pymunk', 'batched'])
def test_a_trial_is_the_episode_of_its_simulation(engine):
    trained = load_controller(find_controller(DEFAULT_CONTROLLER))
    trial = Trial(trained, 'uphill-10', engine, start=2, duration=6.0, transient=1.0)
    simulation = Simulation(
        'biped', 'uphill-10', engine=engine, push=2, solver=trained.solver
    )
    expected = run_episode(simulation, trained.controller(), 6.0).velocity(1.0)
    assert score(trial).score == expected != 0.0


def test_workers_do_not_matter():
    trials = [
        Trial(trained_worm(), terrain, start=start, duration=2.0, transient=0.5)
        for terrain in ('flat', 'hilly-1-10-0') for start in range(2)
    ]
    alone, _ = run_trials(IN_PROCESS, trials)
    with local_workers(2) as workers:
        together, _ = run_trials(workers, trials)
    assert together.tolist() == alone.tolist()
    assert len(set(alone.tolist())) == 4


FAULTS = [parse_faults(text) for text in ('', 'loss=0.6,seed=1', 'broken_actuators=zero:0.5@0.5')]


def mixed_trials(engine='batched'):
    """Return trials of two controllers, with faults and starts, on two grounds."""
    return [
        Trial(trained_worm(seed), terrain, engine, start, faults, duration=2.0, transient=0.5)
        for terrain in ('flat', 'uphill-10') for seed in range(2)
        for start, faults in enumerate(FAULTS)
    ]


def test_trials_side_by_side_are_trials_one_by_one():
    trials = mixed_trials()
    scores, times = run_trials(replace(IN_PROCESS, count=lambda: 3), trials)
    alone = [score(trial) for trial in trials]
    assert scores.tolist() == [one.score for one in alone]
    assert len(set(scores.tolist())) == len(trials)
    assert np.isnan(times).all()
    assert times.shape == (len(trials), 2)


def test_groups_are_of_trials_that_are_alike():
    trials = mixed_trials()
    assert groups_of(trials, 3) == [[0, 1, 2, 3], [4, 5], [6, 7, 8, 9], [10, 11]]
    assert groups_of(trials, 1) == [[*range(6)], [*range(6, 12)]]
    assert groups_of(mixed_trials('pymunk'), 1) == [[i] for i in range(12)]
    longer = [replace(trials[1], duration=3.0), replace(trials[2], transient=0.1)]
    other_cell = replace(trials[0], trained=trials[0].trained.in_arithmetic('float32'))
    assert groups_of([trials[0], *longer, other_cell], 1) == [[0, 2], [1], [3]]


def test_table_csv_and_figure_tell_the_same(worms, tmp_path, capsys):
    terrains = ['flat', 'downhill-20', 'hilly-1-10-0']
    code, out, err = assess(
        *worms, '--terrains', ','.join(terrains), '--starts', 3, '--workers', 1, '--duration', 7,
        '--csv', tmp_path / 'scores.csv', '--figure', tmp_path / 'scores.svg', capsys=capsys,
    )
    assert (code, err) == (0, '')
    with (tmp_path / 'scores.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == (*COLUMNS, 'v_x')
    terrains.append('mean')
    expected = [(w, t, 'pymunk', str(s), '', '') for w in worms for t in terrains for s in range(4)]
    assert [tuple(row[c] for c in COLUMNS) for row in rows] == expected
    scores = np.array([float(row['v_x']) for row in rows]).reshape(2, 4, 4)
    np.testing.assert_allclose(scores[:, 3], scores[:, :3].mean(axis=1), rtol=1e-12)
    assert scores[1, 1, 2] == score(
        Trial(trained_worm(1), 'downhill-20', start=2, duration=7.0)
    ).score
    for worm, of_one in zip(worms, scores, strict=True):
        assert '\n'.join(table(worm, terrains, of_one, 'v_x')) in out
    picture = (tmp_path / 'scores.svg').read_text()
    assert picture.startswith('<?xml')
    assert all(f'<!-- {terrain} -->' in picture for terrain in terrains)


def test_seeds_of_terrains_count_within_their_kind(worms, tmp_path, capsys):
    path = tmp_path / 'scores.csv'
    options = ('--workers', 1, '--duration', 5.1, '--csv', path)
    code, out, err = assess(worms[0], '--terrain-seeds', 2, *options, capsys=capsys)
    assert (code, err) == (0, '')
    with path.open(newline='') as file:
        v_x = {row['terrain']: float(row['v_x']) for row in csv.DictReader(file)}
    kinds = unseen_terrains(2)
    assert list(v_x) == [
        *(name for names in kinds.values() for name in names), *UNSEEN_KINDS[:12], 'mean'
    ]
    assert v_x['hilly-1-20-16'] == score(
        Trial(trained_worm(), 'hilly-1-20-16', duration=5.1)
    ).score
    for kind, names in kinds.items():
        assert v_x[kind] == np.mean([v_x[name] for name in names])
    assert v_x['mean'] == pytest.approx(np.mean([v_x[kind] for kind in UNSEEN_KINDS]), rel=1e-12)
    lines = [line.split()[0] for line in out.splitlines()[2:]]
    assert lines == [worms[0], 'v_x', *UNSEEN_KINDS, 'mean']

    code, out, _ = assess(worms[0], '--terrain-seeds', 1, *options, capsys=capsys)
    assert (code, assess(worms[0], *options, capsys=capsys)[1]) == (0, out)
    assert [line.split()[0] for line in out.splitlines()[4:-1]] == [*UNSEEN_TERRAINS]


def test_lines_of_a_table():
    scores = np.array([[1.0, 0.0, 2.0, 4.0], [3.0, 2.0, 2.0, 2.0]])
    name, head, flat, hilly = table('worm', ['flat', 'hilly'], scores, 'v_x')
    assert name == 'worm'
    assert head.split() == ['v_x', 'mean', 'std', 'of', '3', 'pushed', 'starts']
    assert flat.split() == ['flat', '1.000', '2.000', '2.000']
    assert hilly.split() == ['hilly', '3.000', '2.000', '0.000']
    assert [line.split() for line in table('w', ['flat'], scores[:1, :1], 'v_x')] == [
        ['w'], ['v_x'], ['flat', '1.000']
    ]


def test_summary_of_starts():
    assert summary([1.0, 3.0]) == (2.0, pytest.approx(2.0**0.5))
    assert summary([5.0]) == (5.0, 0.0)
    mean, deviation = summary([1.0, -np.inf])
    assert mean == -np.inf
    assert np.isnan(deviation)


@pytest.mark.parametrize(
    ('arguments', 'words'),
    [
        (['nowhere.npz'], ['nowhere.npz', 'controller file']),
        ([DEFAULT_CONTROLLER, '--terrains', 'flat,hily-1-10-0'], ['hily-1-10-0', "'hilly'"]),
        ([DEFAULT_CONTROLLER, '--engine', 'pymnk'], ['engine', "did you mean 'pymunk'?"]),
        ([DEFAULT_CONTROLLER, '--terrain-seeds', '0'], ['--terrain-seeds', '0', 'from 1 to 1000']),
        ([DEFAULT_CONTROLLER, '--terrain-seeds', '2', '--terrains', 'flat'],
         ['terrain_seeds', '2', 'no --terrain-seeds with --terrains']),
        ([DEFAULT_CONTROLLER, '--terrain-seeds', '2', '--faults', 'loss=0..1'],
         ['terrain_seeds', '2', 'no --terrain-seeds with --faults']),
        ([DEFAULT_CONTROLLER, '--starts', '-1'], ['starts', 'from 0']),
        ([DEFAULT_CONTROLLER, '--duration', '5'], ['duration', '5.0', 'above 5 s']),
        ([DEFAULT_CONTROLLER, '--duration', 'nan'], ['duration', 'nan']),
        ([DEFAULT_CONTROLLER, '--figure', 'scores.xyz'], ['scores.xyz', '.png']),
        ([DEFAULT_CONTROLLER, '--arithmetic', 'int4'], ['--arithmetic', 'int4', 'int8']),
        (['worm-U-D-mlp', '--arithmetic', 'int8'], ['arithmetic', 'a perceptron in integers']),
    ],
)
def test_bad_input_is_one_line(arguments, words, capsys):
    code, out, err = assess(*arguments, capsys=capsys)
    assert (code, out, err.count('\n')) == (2, '', 1)
    assert all(word in err for word in words)


def test_trials_are_in_the_arithmetic_of_the_command(capsys, monkeypatch):
    asked = []

    def pretend(workers, trials):
        asked.extend(trials)
        return np.zeros(len(trials)), np.full((len(trials), 2), np.nan)

    monkeypatch.setattr('snca_ros.commands.assess.run_trials', pretend)
    code, _, _ = assess(DEFAULT_CONTROLLER, '--terrains', 'flat', '--arithmetic', 'int8',
                        '--workers', 1, capsys=capsys)
    assert code == 0
    (trial,) = asked
    assert trial.trained.architecture.arithmetic == 'int8'
    assert trial.trained.architecture.model.bits == 8


def test_csv_that_cannot_be_written_is_refused_before_the_work(worms, capsys):
    code, out, err = assess(
        worms[0], '--terrains', 'flat', '--workers', 1, '--csv', '/proc/nowhere/scores.csv',
        capsys=capsys,
    )
    assert (code, err.count('\n')) == (2, 1)
    assert out == ''
    assert '/proc/nowhere/scores.csv' in err
