"""Statistics of two groups of runs: rank test, correction for several tests, effect size."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq
from scipy.stats import mannwhitneyu, norm

LEVEL = 0.95
"""Level of confidence intervals."""

_MOST_EXACT = 50  # values in a group from which on the normal approximation is used, as in R


@dataclass(frozen=True)
class Comparison:
    """The comparison of two groups.

    Attributes:
        u: Mann-Whitney U of the first group.
        p: two-sided p-value for equal distributions, exact if there are no ties.
        a: Vargha-Delaney A, the probability that a value of the first group is above one of the
            second, ties counting half: 0.5 is no effect.
        a_low, a_high: its confidence interval at `LEVEL`.
    """

    u: float
    p: float
    a: float
    a_low: float
    a_high: float


def compare(first: np.ndarray, second: np.ndarray) -> Comparison:
    """Compare two groups of values, (n_first,) and (n_second,), not empty and without NaN.

    The p-value is that of R's `wilcox.test`: with ties or in large groups it is the normal
    approximation, corrected for ties and continuity.
    """
    together = np.concatenate((first, second))
    exact = len(np.unique(together)) == len(together) and max(len(first), len(second)) < _MOST_EXACT
    test = mannwhitneyu(first, second, method='exact' if exact else 'asymptotic')
    a = float(test.statistic) / (len(first) * len(second))
    interval = effect_interval(a, len(first), len(second))
    return Comparison(float(test.statistic), float(test.pvalue), a, *interval)


def effect_interval(a: float, n_first: int, n_second: int) -> tuple[float, float]:
    """Return the confidence interval at `LEVEL` of an effect size A, for groups of these sizes.

    Newcombe's method 5 (Statistics in Medicine 25:559, 2006): the interval of the values of A whose
    distance from `a` does not exceed z times their standard error. Unlike a bootstrap interval it
    has a width at 0 and 1, where groups do not overlap.
    """
    z2 = norm.ppf(0.5 + LEVEL / 2.0) ** 2 / (n_first * n_second)
    others = 0.5 * (n_first + n_second) - 1.0

    def beyond(x: float) -> float:
        spread = 1.0 + others * ((1.0 - x) / (2.0 - x) + x / (1.0 + x))
        return (x - a) ** 2 - z2 * x * (1.0 - x) * spread

    inside = min(max(a, 1e-9), 1.0 - 1e-9)  # at 0 and 1 themselves, `beyond` is 0
    low = brentq(beyond, 0.0, inside) if a > 0.0 else 0.0
    high = brentq(beyond, inside, 1.0) if a < 1.0 else 1.0
    return low, high


def holm(p: Sequence[float]) -> np.ndarray:
    """Return the p-values of a family of tests with Holm's correction, (n,)."""
    order = np.argsort(p)
    grown = np.array(p)[order] * np.arange(len(p), 0, -1)
    corrected = np.empty(len(p))
    corrected[order] = np.minimum(np.maximum.accumulate(grown), 1.0)
    return corrected


def quartiles(values: np.ndarray) -> np.ndarray:
    """Return lower quartile, median and upper quartile along the first axis, (3, ...).

    Diverged episodes count as -inf.
    """
    with np.errstate(invalid='ignore'):
        found = np.quantile(values, (0.25, 0.5, 0.75), axis=0)
    return np.where(np.isnan(found), -np.inf, found)  # between -inf and a number
