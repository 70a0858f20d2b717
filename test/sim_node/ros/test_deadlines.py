"""Deadlines of steps in real time, missed deadlines, and statistics of step times."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_node.ros.deadlines import ListeningTime, Pace, StepTimes


@given(st.floats(0.0, 0.9), st.integers(1, 10**7))
def test_delays_do_not_accumulate(lateness, n):
    pace = Pace(60.0)
    pace.start(2, 100.0)
    for step in (3, 4, 5):
        pace.note(step, pace.due(step) + lateness / 60.0)
    assert pace.missed == 0
    assert pace.due(2 + 60 * n) == pytest.approx(100.0 + n, abs=1e-6)


def test_a_step_later_than_the_next_deadline_is_missed():
    pace = Pace(100.0)
    pace.start(0, 0.0)
    for step, now in ((1, 0.010), (2, 0.0315), (3, 0.0405), (4, 0.0410), (5, 0.0510)):
        pace.note(step, now)
    assert pace.missed == 2
    assert pace.due(6) == pytest.approx(0.06)


def test_a_delay_of_more_than_a_second_skips_deadlines():
    pace = Pace(100.0)
    pace.start(0, 0.0)
    pace.note(1, 2.015)
    assert pace.missed == 200
    assert pace.due(2) == pytest.approx(2.025)


def test_step_times():
    times = StepTimes()
    times.note(1.0)
    assert times.summary() == {}
    for now in (1.25, 1.5, 1.75, 2.75):
        times.note(now)
    times.restart()
    times.note(100.0)
    assert times.summary() == {
        'step time p50 [ms]': '250.00', 'step time p99 [ms]': '977.50',
        'step time max [ms]': '1000.00',
    }


def test_limits_count_only_the_time_in_which_a_process_ran():
    times = iter([100.0, 100.1, 100.15, 113.15, 113.25, 113.75, 113.85])
    listening = ListeningTime(lambda: next(times))
    counted = [listening.now() for _ in range(6)]
    assert counted == pytest.approx([0.1, 0.15, 0.15, 0.25, 0.25, 0.35])
