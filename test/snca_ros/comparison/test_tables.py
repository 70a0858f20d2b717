"""The tables of the study: the fastest, speeds, vibration."""

import numpy as np
from support.comparison import SNCA, cases_of
from support.made_up_results import first_row, made_up_row

from snca_ros.comparison.figures import draw_all
from snca_ros.comparison.tables import (
    champions_table,
    speeds_table,
    vibration_table,
)


def test_the_fastest_of_a_type_is_so_over_pushed_starts(tmp_path):
    rows = [
        made_up_row(seed=s, v_x_end=v_x, v_x_pushed_mean=mean, v_x_pushed_std=0.25)
        for s, (v_x, mean) in enumerate([(9.0, 1.0), (5.0, 4.0), (7.0, 3.0)])
    ]
    (row,) = champions_table(cases_of(tmp_path, *rows)).rows
    assert row[:2] == ['biped-U-nD-snn-h-flat-batched-reference-seed1', '5.00']
    assert row[4:6] == ['4.00 ± 0.25', '1 to 20']
    assert row[7] == '101 to 120'


def test_vibrating_runs_are_counted_and_compared_with_the_others(tmp_path):
    numbers = [(0.5, 1.0, 8.0), (0.51, 2.0, 8.0), (0.9, 4.0, 4.0), (1.0, -1.0, 0.49)]
    rows = [
        made_up_row(
            seed=s, vibration=share, frequency=1.0 + s, v_x_unseen=unseen, v_x_pushed_mean=v_x
        )
        for s, (share, unseen, v_x) in enumerate(numbers)
    ]
    rows.append(
        made_up_row('comb', vibration=0.0, frequency=9.0, v_x_pushed_mean=2.0, v_x_unseen=-np.inf)
    )
    table = vibration_table(cases_of(tmp_path, *rows))
    assert table.header[2:6] == [
        'power above 8 Hz [%]', 'peak [Hz]', 'above 50 %',
        'pushed mean [m/s] and share kept of those',
    ]
    assert table.rows == [
        ['biped', str(SNCA), '50 to 100', '1.00 to 4.00', '3 of 4', '6.00, 62 %', '8.00, 12 %'],
        ['comb', str(SNCA), '0 to 0', '9.00 to 9.00', '0 of 1', '–', '2.00, -inf %'],
    ]


def test_of_the_first_tables_the_peak_alone_tells_who_vibrates(tmp_path):
    rows = [
        first_row('biped', 'U-nD', 'snn-h', s, frequency=f, v_x_unseen=unseen, v_x_batched=v_x)
        for s, (f, unseen, v_x) in enumerate([(4.0, 1.0, 8.0), (4.1, 2.0, 8.0), (15.0, 4.0, 4.0)])
    ]
    table = vibration_table(cases_of(tmp_path, *rows))
    assert table.header[2:4] == ['frequency [Hz]', 'above 4 Hz']
    assert table.rows == [
        ['biped', str(SNCA), '4.00 to 15.00', '2 of 3', '6.00, 62 %', '8.00, 12 %']
    ]
    kinds = [kind for kind, *_ in draw_all(cases_of(tmp_path / 'drawn', *rows), [])]
    assert kinds == ['boxes', 'medians', 'curves', 'frequency', 'variance']


def test_a_run_that_one_engine_cannot_do_has_no_speed_there(tmp_path):
    cases = cases_of(tmp_path, *(made_up_row(seed=s, v_x_other='') for s in range(3)))
    (row,) = speeds_table(cases).rows
    assert row[5] == '–'
    assert champions_table(cases).rows[0][2] == '–'
    assert draw_all(cases, [])
