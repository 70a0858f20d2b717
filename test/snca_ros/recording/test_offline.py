"""Comparison of a recorded walk with its offline twin."""

import numpy as np
import pytest

from snca_ros.recording.offline import compare_with_twin

TWIN = np.random.default_rng(0).normal(size=(31, 2))
FAILED = 'offline twin: 31 positions of the centre, NOT THE SAME', False


def apart(change, step=7):
    centers = TWIN.copy()
    centers[step:, 1] = change(centers[step:, 1])
    return centers


def nothing(x):
    return np.full_like(x, np.nan)


def a_bit_more(x):
    return np.nextafter(x, np.inf)


@pytest.mark.parametrize('may_differ', [False, True])
def test_same_bits(may_differ):
    assert compare_with_twin(TWIN.copy(), TWIN, may_differ) == (
        'offline twin: 31 positions of the centre, bit for bit the same', True
    )


@pytest.mark.parametrize('change', [a_bit_more, nothing])
def test_one_bit_or_a_missing_position_fails_in_lockstep(change):
    assert compare_with_twin(apart(change), TWIN, may_differ=False) == FAILED


@pytest.mark.parametrize('change', [a_bit_more, nothing])
@pytest.mark.parametrize('step', [0, 7, 30])
def test_reports_the_first_step_that_differs_if_it_may(change, step):
    text, as_expected = compare_with_twin(apart(change, step), TWIN, may_differ=True)
    assert f'the same until step {step}, then changed' in text
    assert as_expected


@pytest.mark.parametrize('n', [0, 30, 32])
def test_another_length_fails_in_lockstep(n):
    centers = np.resize(TWIN, (n, 2))
    assert compare_with_twin(centers, TWIN, may_differ=False) == FAILED
    assert compare_with_twin(centers, TWIN, may_differ=True) == (FAILED[0], True)
