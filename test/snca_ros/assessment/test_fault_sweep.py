"""The sweep of assess --faults: which values, which episodes, and what is told of them."""

import csv

import numpy as np
import pytest
from support.assessment import assess, trained_worm

from sim_node.errors import InvalidInput
from snca_ros.assessment.fault_sweep import COLUMNS, parse_sweep, table
from snca_ros.assessment.trials import Trial, score
from snca_ros.bundled import DEFAULT_CONTROLLER
from snca_ros.faults import Faults


@pytest.mark.parametrize(('text', 'label', 'values'), [
    ('loss=0..0.9..0.3', 'loss=x', [0, 0.3, 0.6, 0.9]),
    ('loss=0.5..0.6', 'loss=x', [0.5, 0.51, 0.52, 0.53, 0.54, 0.55, 0.56, 0.57, 0.58, 0.59, 0.6]),
    ('delay=1..4', 'delay=x', [1, 2, 3, 4]),
    ('seed=3,delay=0..10..5,loss=0.1', 'seed=3,delay=x,loss=0.1', [0, 5, 10]),
    ('death=0..1..0.25@5', 'death=x@5', [0, 0.25, 0.5, 0.75, 1]),
    ('broken_sensors=zero:0.5@1..7..2', 'broken_sensors=zero:0.5@x', [1, 3, 5, 7]),
    ('loss=0..1..0.4', 'loss=x', [0, 0.4, 0.8]),
])
def test_values_of_a_sweep(text, label, values):
    sweep = parse_sweep(text)
    assert (sweep.text, sweep.label, list(sweep.values)) == (text, label, values)
    assert len(sweep.faults) == len(values)


def test_faults_of_a_sweep():
    assert parse_sweep('seed=3,loss=0..0.2..0.1,death=0.5@1').faults == tuple(
        Faults(loss=loss, death='0.5@1', seed=3) for loss in (0.0, 0.1, 0.2)
    )


@pytest.mark.parametrize('text', [
    'loss=0.5', 'loss', '', 'loss=0..0.5,delay=0..3', 'loss=0.5..0.1', 'loss=0..0', 'loss=0..1..0',
    'loss=0..1..0.0001', 'loss=0..2', 'los=0..1', 'delay=0..1..0.5', 'loss=0..', 'death=0..1@',
])
def test_bad_sweeps_are_refused(text):
    with pytest.raises(InvalidInput):
        parse_sweep(text)


def test_table_csv_and_figure_tell_the_same(worms, tmp_path, capsys):
    texts = ['loss=0..0.8..0.4,seed=5', 'broken_actuators=zero:0..1..0.5']
    code, out, err = assess(
        *worms, '--faults', texts[0], '--faults', texts[1], '--starts', 1, '--workers', 1,
        '--csv', tmp_path / 'sweep.csv', '--figure', tmp_path / 'sweep.svg', capsys=capsys,
    )
    assert (code, err) == (0, '')
    with (tmp_path / 'sweep.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert tuple(rows[0]) == (*COLUMNS, 'v_x')
    sweeps = [parse_sweep(text) for text in texts]
    assert [tuple(row[c] for c in COLUMNS) for row in rows] == [
        (worm, sweep.text, str(x), 'flat', 'pymunk', str(start), '', '')
        for sweep in sweeps for worm in worms for x in sweep.values for start in range(2)
    ]
    scores = np.array([float(row['v_x']) for row in rows]).reshape(2, 2, 3, 2)
    exact = score(Trial(trained_worm(1), 'flat')).score
    assert (scores[:, 1, 0, 0] == exact).all()  # no loss, nothing broken
    lossy = Faults(loss=0.4, seed=6)
    assert scores[0, 1, 1, 1] == score(
        Trial(trained_worm(1), 'flat', start=1, faults=lossy)
    ).score
    assert scores[0, 1, 1, 1] != exact
    for sweep, of_sweep in zip(sweeps, scores, strict=True):
        assert '\n'.join(table(worms, sweep, of_sweep)) in out
    assert scores[1, :, 2] == pytest.approx(0.0, abs=0.01)  # all actuators broken: no walk
    picture = (tmp_path / 'sweep.svg').read_text()
    assert all(f'<!-- {sweep.label} -->' in picture for sweep in sweeps)


def test_lines_of_a_table():
    sweep = parse_sweep('delay=0..1')
    head, names, *lines = table(['a', 'b'], sweep, np.array([[[1.0, 3.0]] * 2, [[2.0, 2.0]] * 2]))
    assert head.startswith('delay=x: ')
    assert '2 starts' in head
    assert names.split() == ['x', 'a', 'b']
    assert [line.split() for line in lines] == [
        [x, '2.000', '1.414', '2.000', '0.000'] for x in '01'
    ]


@pytest.mark.parametrize(('text', 'words'), [
    ('loss=0.3', ['faults', 'FROM..TO']),
    ('loss=0..1.5', ['loss', '1.05', 'from 0 to 1']),
    ('broken_actuators=zero:voxel_9_9@0..5', ['broken_actuators', 'voxel_9_9']),
    ('death=voxel_9_9@0..5', ['death', 'voxel_9_9']),
])
def test_bad_faults_are_one_line(text, words, capsys):
    code, _, err = assess(DEFAULT_CONTROLLER, '--faults', text, '--workers', 1, capsys=capsys)
    assert (code, err.count('\n')) == (2, 1)
    assert all(word in err for word in words)
