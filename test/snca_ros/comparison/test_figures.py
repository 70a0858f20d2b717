"""Curves and figures, and that they tell what the table says."""

import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.comparison import cases_of
from support.made_up_results import made_up_row, paper_rows

from sim_node.errors import InvalidInput
from snca_ros.campaign.results import read_curve
from snca_ros.comparison.figures import draw_all, median_curve
from snca_ros.comparison.pairwise import contrasts
from snca_ros.comparison.runs import (
    read_cases,
)


def test_curve_is_read_and_damage_told(tmp_path):
    path = tmp_path / 'run.csv'
    path.write_text('episodes,best_so_far\n36,-inf\n71,0.5\n106,0.5\n')
    assert read_curve(path).tolist() == [[36.0, -np.inf], [71.0, 0.5], [106.0, 0.5]]
    for text in (
        '', 'episodes,best\n1,2\n', 'episodes,best_so_far\n', '\0',
        'episodes,best_so_far\n36,1\n71\n', 'episodes,best_so_far\n36,1,2\n',
        'episodes,best_so_far\n36,x\n',
        'episodes,best_so_far\n71,1\n36,1\n', 'episodes,best_so_far\n36,nan\n',
    ):
        path.write_text(text)
        with pytest.raises(InvalidInput, match=r'run\.csv: file'):
            read_curve(path)
    with pytest.raises(InvalidInput, match='No such file'):
        read_curve(tmp_path / 'none.csv')


def test_median_curve_worked_by_hand():
    one = np.array([[2.0, 1.0], [6.0, 5.0]])
    two = np.array([[1.0, 0.0], [4.0, 3.0], [8.0, 9.0]])
    episodes, (low, median, high) = median_curve([one, two])
    assert episodes.tolist() == [2.0, 4.0, 6.0]  # where both have been and neither has ended
    assert median.tolist() == [0.5, 2.0, 4.0]
    assert low.tolist() == [0.25, 1.5, 3.5]
    assert high.tolist() == [0.75, 2.5, 4.5]


@given(st.lists(st.lists(st.tuples(st.integers(1, 99), st.floats(0, 9)), min_size=1), min_size=1))
def test_median_curve_never_falls(runs):
    curves = [
        np.array([sorted(n for n, _ in run), sorted(v for _, v in run)], float).T for run in runs
    ]
    episodes, found = median_curve(curves)
    assert found.shape == (3, len(episodes))
    assert (np.diff(found, axis=1) >= -1e-12).all()
    assert (np.diff(found, axis=0) >= -1e-12).all()


def test_figures_are_files_and_tell_what_the_table_says(drawn):
    names = {path.stem for path in drawn.glob('*.svg')}
    kinds = ('boxes', 'medians', 'curves', 'vibration', 'variance')
    assert names == {f'{kind}-{shape}' for kind in kinds for shape in ('biped', 'comb', 'worm')}
    rows = [row for row in paper_rows(4, ('worm',)) if row['architecture'] == 'U-D']
    medians = ''.join(ET.parse(drawn / 'medians-worm.svg').getroot().itertext())
    for column in ('v_x_end', 'v_x_unseen', 'v_x_pushed_mean', 'v_x_robust_mean'):
        assert f'{np.median([float(row[column]) for row in rows]):.1f}' in medians
    boxes = ''.join(ET.parse(drawn / 'boxes-worm.svg').getroot().itertext())
    shown = [
        c for c in contrasts(read_cases([drawn.parent]))
        if c.shape == 'worm' and c.measure in ('v_x_end', 'v_x_unseen')
    ]
    assert len(re.findall(r'\d\.\d{3} \(', boxes)) == len(shown) == 6
    assert all(f'{c.result.p:.3f} ({c.p_holm:.3f})' in boxes for c in shown)
    assert boxes.count('n = 4') == 3


def test_robots_that_all_diverged_can_be_drawn(tmp_path):
    names = 'v_x_end', 'v_x_other', 'v_x_unseen', 'v_x_pushed_mean', 'v_x_robust_mean'
    speeds = dict.fromkeys(names, -np.inf)
    assert len(draw_all(cases_of(tmp_path, made_up_row(**speeds)), [])) == 5


def test_types_with_settings_have_rows_of_their_own_in_the_table_of_medians(tmp_path):
    settings = {}, {'terrain': 'uphill-10'}, {'strategy': 'cma'}
    rows = [made_up_row(settings=of_run, v_x_unseen=9.9) for of_run in settings]
    rows.append(made_up_row(as_printed=True, v_x_unseen=8.8))
    drawn = {kind: svg for kind, _, svg in draw_all(cases_of(tmp_path, *rows), [])}
    texts = [e.text for e in ET.fromstring(drawn['medians']).iter() if e.text]
    assert texts.count('9.9') == 3
    assert texts.count('8.8') == 1
    assert {'U-nD, uphill-10 es', 'U-nD, flat es', 'U-nD, flat cma'} <= set(texts)
