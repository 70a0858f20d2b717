"""Every pair of types compared, and which comparisons are shown."""

import csv

import numpy as np
import pytest
from support.comparison import SNCA, cases_of
from support.made_up_results import made_up_row, paper_rows

from snca_ros.comparison.pairwise import COLUMNS, contrasts, shown_contrasts
from snca_ros.comparison.rank_test import compare
from snca_ros.comparison.runs import (
    read_cases,
)
from snca_ros.comparison.tables import (
    factors_table,
    format_p,
)


def test_every_pair_is_compared_on_each_shape_and_corrected_in_its_family(tmp_path):
    cases = cases_of(tmp_path, *paper_rows(6))
    found = contrasts(cases)
    assert len(found) == 3 * 4 * 3
    family = [c for c in found if (c.shape, c.measure) == ('comb', 'v_x_unseen')]
    assert [(str(c.first), str(c.second)) for c in family] == [
        ('U-nD SNN-H', 'U-D MLP'), ('U-nD SNN-H', 'nU-D MLP'), ('U-D MLP', 'nU-D MLP')
    ]
    p = sorted((c.result.p, c.p_holm) for c in family)
    assert p[0][1] == min(1.0, 3.0 * p[0][0])
    assert p[1][1] == max(p[0][1], min(1.0, 2.0 * p[1][0]))
    assert p[2][1] == max(p[1][1], p[2][0])
    numbers = [
        np.array([float(run.row['v_x_unseen']) for run in cases['comb'][of_type]])
        for of_type in (family[0].first, family[0].second)
    ]
    assert family[0].result == compare(*numbers)
    assert family[0].medians == tuple(np.median(numbers, axis=1))


def test_of_many_types_the_first_is_shown_with_each(tmp_path):
    rows = [
        made_up_row('comb', a, m) for a in ('U-nD', 'U-D') for m in ('mlp', 'snn', 'snn-h')
    ]
    found = contrasts(cases_of(tmp_path, *rows, *paper_rows(1, ('biped',))))
    shown = shown_contrasts(found)
    assert sum(c.shape == 'comb' for c in found) == 4 * 15
    assert sum(c.shape == 'comb' for c in shown) == 4 * 5
    assert {c.first for c in shown if c.shape == 'comb'} == {SNCA}
    assert [c for c in shown if c.shape == 'biped'] == [c for c in found if c.shape == 'biped']


def test_statistics_csv_has_every_contrast(drawn):
    with (drawn / 'statistics.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    found = contrasts(read_cases([drawn.parent]))
    assert tuple(rows[0]) == COLUMNS
    assert len(rows) == len(found)
    for row, contrast in zip(rows, found, strict=True):
        assert (row['shape'], row['measure']) == (contrast.shape, contrast.measure)
        assert (row['first'], row['n_second']) == (str(contrast.first), '4')
        assert float(row['p']) == contrast.result.p
        assert float(row['p_holm']) == contrast.p_holm
        assert float(row['a_low']) == contrast.result.a_low
        assert float(row['median_second']) == contrast.medians[1]


def test_architectures_and_neuron_models_are_compared_where_all_else_is_alike(tmp_path):
    speeds = {
        ('U-nD', 'snn-h'): 5.0, ('U-nD', 'mlp'): 2.0, ('U-D', 'snn-h'): 4.0, ('U-D', 'mlp'): 3.0,
    }
    rows = [
        made_up_row(shape, *of_type, seed, v_x_end=v_x + seed, v_x_unseen=-v_x,
                    v_x_pushed_mean=1.0, v_x_robust_mean=v_x)
        for shape in ('biped', 'comb') for of_type, v_x in speeds.items() for seed in range(3)
    ]
    rows.append(made_up_row('worm', 'nU-D', 'snn', v_x_end=9.0))  # has nothing to be compared with
    table = factors_table(cases_of(tmp_path, *rows))
    measures = ['end of evolution', 'unseen terrains', 'pushed mean', 'robust']
    assert table.header == ['first', 'second', 'with', 'shapes', *measures]
    assert table.rows == [
        ['SNN-H', 'MLP', 'U-D', '2', '2', '0', '0', '2'],
        ['SNN-H', 'MLP', 'U-nD', '2', '2', '0', '0', '2'],
        ['U-nD', 'U-D', 'MLP', '2', '0', '2', '0', '0'],
        ['U-nD', 'U-D', 'SNN-H', '2', '2', '0', '0', '2'],
    ]
    assert factors_table(cases_of(tmp_path / 'one', rows[0])).rows == []


def test_types_with_settings_are_compared_with_their_like(tmp_path):
    rows = [
        made_up_row('biped', architecture, 'snn', settings={'terrain': terrain})
        for terrain in ('flat', 'uphill-10') for architecture in ('U-D', 'nU-D')
    ]
    assert [row[:4] for row in factors_table(cases_of(tmp_path, *rows)).rows] == [
        ['U-D', 'nU-D', 'SNN, flat', '1'], ['U-D', 'nU-D', 'SNN, uphill-10', '1'],
    ]


@pytest.mark.parametrize(
    ('p', 'told'),
    [(0.0009, '< 0.001'), (0.001, '0.001'), (0.0503, '0.0503'), (0.0496, '0.0496'), (0.3, '0.300')],
)
def test_a_p_value_tells_its_side_of_the_level(p, told):
    assert format_p(p) == told
