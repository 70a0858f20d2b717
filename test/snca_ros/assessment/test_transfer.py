"""The transfer matrix: controllers in many bodies, as table, CSV, JSON and heat map."""

import csv
import json

import numpy as np
import pytest
from support.assessment import assess, trained_worm
from support.controller_files import make

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from snca_ros.assessment import transfer
from snca_ros.assessment.figures import draw_transfer
from snca_ros.assessment.transfer import in_bodies, matrix, transfer_trials
from snca_ros.assessment.trials import Trial, score
from snca_ros.controller_file import save_controller
from snca_ros.evolution.tasks import TASKS
from snca_ros.figures import write_figure

WALK = TASKS['walk']
BODIES = tuple(map(parse_morphology, ('worm-3x1', '11-10', '111x')))


@pytest.fixture
def placed():
    """A uniform worm, a uniform corner and a non-uniform worm, in three bodies."""
    minds = [trained_worm(), make('U-D', shape='11-10'), make('nU-D', shape='111')]
    return in_bodies(['worm', 'corner', 'own'], minds, BODIES)


def test_pairs_and_homes(placed):
    assert placed.home.tolist() == [
        [True, False, False], [False, True, False], [True, False, False]
    ]
    assert placed.fits.tolist() == [[True] * 3, [True] * 3, [True, False, False]]
    assert [(i, j) for i, j, _ in placed.pairs()] == [*np.ndindex(2, 3), (2, 0)]
    for _, j, robot in placed.pairs():
        assert robot.morphology.grid_string == BODIES[j].grid_string
    assert placed.named_robots()[0][2] == 'worm in 111x without voxel_3_0'
    again = in_bodies(['worm'], [trained_worm().in_body('11-10')], (*BODIES, *BODIES))
    assert again.labels == placed.labels  # each body once
    assert again.home.tolist() == [[True, False, False]]  # that of its evolution
    with pytest.raises(InvalidInput, match=r'shape: got .11-10., expected 111, or less of it'):
        in_bodies(['own'], [make('nU-D', shape='111')], BODIES[1:2])


def test_trials_are_ordered_by_controller_body_start_and_terrain(placed):
    trials = transfer_trials(placed, ['flat', 'uphill-10'], 'batched', 2, 6.0)
    assert len(trials) == 7 * 2 * 2
    found = [(t.trained.morphology.grid_string, t.start, t.terrain) for t in trials[:8]]
    assert found == [(grid, start, terrain) for grid in ('111', '11-10') for start in (0, 1)
                     for terrain in ('flat', 'uphill-10')]
    assert {(t.engine, t.duration) for t in trials} == {('batched', 6.0)}


def test_matrix_is_over_pushed_starts_and_terrains(placed):
    scores = np.random.default_rng(0).normal(size=(7, 4, 2))
    scores[1, 2, 0] = -np.inf  # diverged
    means, deviations = matrix(placed, scores)
    assert means[0, 0] == pytest.approx(scores[0, 1:].mean(), rel=1e-12)
    per_start = [(a + b) / 2 for a, b in scores[0, 1:].tolist()]
    middle = sum(per_start) / 3
    variance = sum((x - middle) ** 2 for x in per_start) / 2
    assert deviations[0, 0] == pytest.approx(variance**0.5, rel=1e-12)
    assert means[0, 1] == -np.inf
    assert np.isnan(means[2, 1:]).all()
    assert means[2, 0] == pytest.approx(scores[6, 1:].mean(), rel=1e-12)
    exact, none = matrix(placed, scores[:, :1])
    assert exact[1, 2] == scores[5, 0].mean()
    assert none[1, 2] == 0.0


def test_table_marks_home_and_what_does_not_fit(placed):
    means = np.array([[1.0, -2.25, -np.inf], [0.5, 12.125, 3.0], [4.0, np.nan, np.nan]])
    head, *rows = transfer.table(placed, means)
    assert head.split('  ')[-1].strip() == '111x without voxel_3_0'
    assert [row.split() for row in rows[:3]] == [
        ['worm', '1.000*', '-2.250', '-inf'], ['corner', '0.500', '12.125*', '3.000'],
        ['own', '4.000*', '-', '-'],
    ]
    ends = [head.index('worm-3x1') + 8, head.index('11-10') + 5]
    for row, number in zip(rows, ('-2.250', '12.125'), strict=False):
        assert row.index(number) + len(number) == ends[1]
    assert rows[0].index('1.000') + 5 == ends[0]
    assert rows[3:] == [
        '* the body that the controller was evolved in',
        '- a non-uniform controller, which has no cells for this body',
    ]


@pytest.mark.parametrize('suffix', ['svg', 'png'])
def test_heat_map_names_minds_bodies_and_numbers(placed, tmp_path, suffix):
    means = np.array([[1.0, -2.25, -np.inf], [0.5, 12.125, 3.0], [4.0, np.nan, np.nan]])
    path = tmp_path / f'matrix.{suffix}'
    write_figure(draw_transfer(placed, means, WALK), path)
    assert path.stat().st_size > 1000
    if suffix == 'svg':
        shown = [*placed.names, *placed.labels, '-2.25', '12.12', '-inf', '–', 'v_x [m/s]']
        assert [text for text in shown if f'<!-- {text} -->' not in path.read_text()] == []
        assert path.read_text().count('stroke: #ff0000') == 3  # frames of homes
    assert draw_transfer(placed, np.full((3, 3), np.nan), WALK) is not None


def test_command_writes_what_it_prints(worms, tmp_path, capsys):
    save_controller(tmp_path / 'own.npz', make('nU-D', shape='111'))
    files = [worms[0], str(tmp_path / 'own.npz')]
    code, out, err = assess(
        *files, '--shape', '111,11-10', '--starts', 2, '--duration', 6, '--workers', 1,
        '--csv', tmp_path / 'm.csv', '--json', tmp_path / 'm.json', '--figure', tmp_path / 'm.svg',
        capsys=capsys,
    )
    assert (code, err) == (0, '')
    with (tmp_path / 'm.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == (*transfer.COLUMNS, 'v_x')
    assert [(r['controller'], r['body'], r['home'], r['start']) for r in rows] == [
        (name, body, str(body == '111'), str(start))
        for name, body in ((files[0], '111'), (files[0], '11-10'), (files[1], '111'))
        for start in range(3)
    ]
    values = np.array([float(row['v_x']) for row in rows]).reshape(3, 3)
    robot = trained_worm().in_body('11-10')
    assert values[1, 2] == score(Trial(robot, 'flat', start=2, duration=6.0)).score
    found = json.loads((tmp_path / 'm.json').read_text())
    assert len(found['scores']) == 9
    assert [(m['controller'], m['body'], m['home']) for m in found['matrix']] == [
        (files[0], '111', True), (files[0], '11-10', False), (files[1], '111', True)
    ]
    np.testing.assert_allclose(
        [m['mean'] for m in found['matrix']], values[:, 1:].mean(axis=1), rtol=1e-12
    )
    assert f'{values[1, 1:].mean():.3f}' in out
    assert 'on flat in the pymunk engine, mean of 2 pushed starts\n' in out
    assert '<!-- 11-10 -->' in (tmp_path / 'm.svg').read_text()


def test_damage_and_other_bodies_in_the_other_tables(worms, tmp_path, capsys, monkeypatch):
    asked = []

    def pretend(workers, trials):
        asked.extend(trials)
        return np.zeros(len(trials)), np.full((len(trials), 2), np.nan)

    monkeypatch.setattr('snca_ros.commands.assess.run_trials', pretend)
    code, out, _ = assess(worms[0], '--without', 'voxel_0_0', '--terrains', 'flat', '--workers', 1,
                          capsys=capsys)
    assert code == 0
    assert asked.pop().trained.morphology.grid_string == 'x11'
    assert f'{worms[0]} without voxel_0_0\n' in out
    code, out, _ = assess(
        worms[0], '--shape', '111,11-10', '--without', 'voxel_1_0', '--workers', 1, capsys=capsys
    )
    assert (code, out) == (2, '')  # the worm falls apart
    code, out, _ = assess(
        worms[0], '--shape', '11-10,comb', '--faults', 'loss=0..0.5..0.5', '--starts', 0,
        '--workers', 1, capsys=capsys,
    )
    assert code == 0
    assert [(t.trained.morphology.name, t.faults.loss) for t in asked] == [
        ('11-10', 0.0), ('11-10', 0.5), ('comb', 0.0), ('comb', 0.5)
    ]
    assert f'{worms[0]} in comb' in out


@pytest.mark.parametrize(('options', 'words'), [
    (['--shape', 'biped,bipd'], ['morphology', "'bipd'", "'biped'"]),
    (['--shape', 'biped,'], ['morphology', "''"]),
    (['--shape', 'biped', '--without', 'voxel_1_0'], ['voxel', "'voxel_1_0'"]),
    (['--shape', 'biped', '--terrain-seeds', '2'], ['no --terrain-seeds with --shape']),
    (['--without', 'voxel_1_0'], ['without', "'voxel_1_0'", 'one connected piece']),
])
def test_bad_input_is_one_line(worms, options, words, capsys):
    code, out, err = assess(worms[0], *options, capsys=capsys)
    assert (code, out, err.count('\n')) == (2, '', 1)
    assert all(word in err for word in words)
