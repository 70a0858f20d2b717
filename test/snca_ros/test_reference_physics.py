"""Rows of the paper's campaign are what the code gives now, to the bit, in both engines.

They were made by earlier commits: as long as this holds, runs of later ones belong beside them. On
another kind of machine or C library roundings may differ, as in `test_first_physics`.
"""

import csv

import pytest
from support.paths import ROOT

from snca_ros.assessment.trials import Trial, score
from snca_ros.controller_file import load_controller

RESULTS = ROOT / 'results' / 'paper'
ROWS = {row['run']: row for row in csv.DictReader((RESULTS / 'results.csv').open())}
CASES = 'biped-U-nD-snn-h', 'biped-U-D-mlp', 'comb-nU-D-mlp', 'worm-U-nD-snn-h', 'worm-U-D-mlp'


@pytest.mark.parametrize('case', CASES)
@pytest.mark.parametrize(('column', 'terrain', 'engine'), [
    ('v_x_end', 'flat', 'batched'), ('v_x_other', 'flat', 'pymunk'),
    ('steppy-1-30', 'steppy-1-30-12', 'pymunk'),
])
def test_a_row_is_what_its_controller_does(case, column, terrain, engine):
    run = f'{case}-flat-batched-reference-seed0'
    trained = load_controller(RESULTS / 'controllers' / f'{run}.npz')
    assert trained.solver.physics == 'reference'
    assert score(Trial(trained, terrain, engine)).score == float(ROWS[run][column])
