"""The statistics against published tables, counting by hand, exact fractions and simulation."""

from fractions import Fraction
from itertools import combinations
from math import comb, erf, erfc, sqrt

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import mannwhitneyu

from snca_ros.comparison.rank_test import compare, effect_interval, holm, quartiles

# The two-sample example of the help page of R's wilcox.test (Hollander & Wolfe 1973, 69f.):
# permeability of the human chorioamnion; W = 35, and 0.1272 is the exact p of the greater side.
AT_TERM = [0.80, 0.83, 1.89, 1.04, 1.45, 1.38, 1.91, 1.64, 0.73, 1.46]
EARLIER = [1.15, 0.88, 0.90, 0.74, 1.21]


def counted_u(first, second) -> Fraction:
    """Return U by its definition: pairs in which the first is above, ties counting half."""
    return sum(
        (Fraction(int(a > b) * 2 + int(a == b), 2) for a in first for b in second), Fraction(0)
    )


def counted_p(first, second) -> Fraction:
    """Return the exact two-sided p, from every way of drawing the first group."""
    together, n = [*first, *second], len(first)
    drawn = []
    for chosen in combinations(range(len(together)), n):
        rest = [together[i] for i in range(len(together)) if i not in chosen]
        drawn.append(counted_u([together[i] for i in chosen], rest))
    u = counted_u(first, second)
    tail = min(sum(d >= u for d in drawn), sum(d <= u for d in drawn))
    return min(Fraction(1), Fraction(2 * tail, comb(len(together), n)))


def test_the_example_of_rs_help_page():
    result = compare(np.array(AT_TERM), np.array(EARLIER))
    assert result.u == 35.0
    assert result.p / 2.0 == pytest.approx(0.1272, abs=5e-5)
    assert result.a == 0.7


@pytest.mark.parametrize(
    ('n_first', 'n_second', 'u', 'p'),
    [
        # Mann & Whitney 1947, table I: P(U <= u); two-sided is twice that.
        (3, 3, 0, 2 * 0.050), (3, 3, 1, 2 * 0.100), (3, 3, 2, 2 * 0.200),
        (4, 4, 1, 2 * 0.029), (5, 5, 4, 2 * 0.048), (6, 6, 5, 2 * 0.021),
    ],
)
def test_the_first_published_table(n_first, n_second, u, p):
    first, second = np.arange(n_first, dtype=float), np.arange(n_second) + float(n_first)
    first[-1] = n_first - 0.5 + u  # above u of the second
    result = compare(first, second)
    assert result.u == u == counted_u(first, second)
    assert result.p == pytest.approx(p, abs=1.1e-3)
    assert result.p == pytest.approx(float(counted_p(first, second)), rel=1e-12)


@given(st.permutations(range(8)), st.integers(1, 7))
def test_without_ties_p_is_the_share_of_draws(order, n):
    first, second = np.array(order[:n], float), np.array(order[n:], float)
    result = compare(first, second)
    assert result.p == pytest.approx(float(counted_p(first.tolist(), second.tolist())), rel=1e-12)
    assert result.a == float(counted_u(first.tolist(), second.tolist()) / (n * (8 - n)))


def test_with_ties_p_is_the_corrected_normal_approximation():
    first, second = [1.0, 2.0, 2.0, 3.0, 5.0], [2.0, 4.0, 5.0, 5.0, 6.0]
    result = compare(np.array(first), np.array(second))
    assert result.u == float(counted_u(first, second)) == 5.0
    # By hand: variance 25/12 · (11 - (27 - 3 + 27 - 3) / (10 · 9)) for three 2s and three 5s,
    # z = (12.5 - 5 - 0.5) / 4.670 = 1.499, which the normal table gives 0.134 on both sides.
    spread = sqrt(25.0 / 12.0 * (11.0 - 48.0 / 90.0))
    assert result.p == pytest.approx(erfc((12.5 - 5.0 - 0.5) / spread / sqrt(2.0)), rel=1e-12)
    assert result.p == pytest.approx(0.1339, abs=1e-4)


def test_diverged_runs_are_the_slowest():
    result = compare(np.array([-np.inf, 2.0, 5.0]), np.array([3.0, 4.0, 6.0]))
    same = compare(np.array([-9.0, 2.0, 5.0]), np.array([3.0, 4.0, 6.0]))
    assert result == same
    assert compare(np.array([-np.inf] * 3), np.array([-np.inf] * 3)).p == 1.0


def test_swapping_the_groups_mirrors_everything():
    there, back = compare(*map(np.array, (AT_TERM, EARLIER))), compare(
        *map(np.array, (EARLIER, AT_TERM))
    )
    assert there.p == back.p
    assert there.u + back.u == 50.0
    assert (there.a, there.a_low, there.a_high) == pytest.approx(
        (1.0 - back.a, 1.0 - back.a_high, 1.0 - back.a_low)
    )


@given(st.integers(1, 40), st.integers(1, 40), st.floats(0.0, 1.0))
def test_interval_ends_are_roots_of_newcombes_polynomial(n_first, n_second, share):
    a = round(share * n_first * n_second) / (n_first * n_second)
    low, high = effect_interval(a, n_first, n_second)
    assert 0.0 <= low <= a <= high <= 1.0
    assert low < high
    # (x - a)² (2 - x)(1 + x) = z²/(mn) x (1 - x) [(2 - x)(1 + x) + k ((1 - x)(1 + x) + x (2 - x))]
    x, k = np.poly1d([1.0, 0.0]), (n_first + n_second) / 2.0 - 1.0
    z2 = 1.959963984540054**2 / (n_first * n_second)
    weights = (2 - x) * (1 + x)
    spread = weights + k * ((1 - x) * (1 + x) + x * (2 - x))
    roots = ((x - a) ** 2 * weights - z2 * x * (1 - x) * spread).roots
    real = roots[np.abs(roots.imag) < 1e-6].real
    assert np.abs(real - low).min() < 1e-6
    assert np.abs(real - high).min() < 1e-6


def test_groups_that_do_not_overlap_leave_doubt():
    few, many = (effect_interval(1.0, n, n) for n in (3, 30))
    assert few[1] == many[1] == 1.0
    assert 0.3 < few[0] < 0.6 < 0.9 < many[0] < 1.0


@pytest.mark.parametrize('shift', [0.0, 1.0, 2.5])
def test_the_interval_covers_the_truth_as_often_as_it_says(shift):
    truth = 0.5 * (1.0 + erf(shift / 2.0))  # A of two unit normals
    rng = np.random.default_rng(3)
    covered = 0
    for _ in range(1000):
        first, second = rng.normal(shift, 1.0, 10), rng.normal(0.0, 1.0, 10)
        a = (first[:, None] > second).mean()
        low, high = effect_interval(a, 10, 10)
        covered += low <= truth <= high
    assert 0.93 <= covered / 1000 <= 0.985


def test_holm_worked_by_hand():
    # Sorted 0.005 · 4, 0.01 · 3, 0.03 · 2, 0.04 · 1, and none below the one before it.
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.4, 0.6]).tolist() == [0.8, 0.8]
    assert holm([0.04]).tolist() == [0.04]
    assert holm([]).tolist() == []


def test_quartiles_with_diverged_runs():
    assert quartiles(np.array([1.0, 2.0, 3.0, 4.0, 5.0])).tolist() == [2.0, 3.0, 4.0]
    assert quartiles(np.array([-np.inf, 1.0, 2.0, 3.0])).tolist() == [-np.inf, 1.5, 2.25]
    assert quartiles(np.array([[-np.inf, 1.0], [-np.inf, 3.0]])).tolist() == [
        [-np.inf, 1.5], [-np.inf, 2.0], [-np.inf, 2.5]
    ]


@pytest.mark.parametrize(('n', 'method'), [(4, 'exact'), (49, 'exact'), (50, 'asymptotic')])
def test_the_test_is_scipys_exact_one_in_small_groups(n, method):
    rng = np.random.default_rng(n)
    first, second = rng.normal(size=n), rng.normal(0.5, size=10)
    expected = mannwhitneyu(first, second, alternative='two-sided', method=method)
    result = compare(first, second)
    assert (result.u, result.p) == (expected.statistic, expected.pvalue)
