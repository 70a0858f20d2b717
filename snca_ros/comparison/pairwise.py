"""Pairwise comparison of types of controllers on each shape."""

import csv
import io
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from snca_ros.comparison.rank_test import Comparison, compare, holm, quartiles
from snca_ros.comparison.runs import Cases, ControllerType, column_of, known_measures

COLUMNS = (
    'shape', 'measure', 'first', 'second', 'n_first', 'n_second', 'median_first', 'median_second',
    'u', 'p', 'p_holm', 'a', 'a_low', 'a_high',
)
"""Columns of statistics.csv; u and a are those of the first type."""

_MOST_PAIRED = 3


@dataclass(frozen=True, eq=False)
class Contrast:
    """The comparison of two types of controllers on a shape, in one of `MEASURES`.

    `p_holm` is corrected for the family of all pairs of types on the shape in that measure.
    """

    shape: str
    measure: str
    first: ControllerType
    second: ControllerType
    groups: tuple[np.ndarray, np.ndarray]
    result: Comparison
    p_holm: float

    @property
    def medians(self) -> tuple[float, float]:
        """Return the median of each group [m/s]."""
        first, second = self.groups
        return float(quartiles(first)[1]), float(quartiles(second)[1])


def contrasts(cases: Cases) -> list[Contrast]:
    """Return the contrasts of all pairs of types on every shape, in each measure of all runs."""
    found = []
    measures = known_measures(cases)
    for shape, of_shape in cases.items():
        for measure in measures:
            values = {c: column_of(runs, measure) for c, runs in of_shape.items()}
            pairs = list(combinations(values, 2))
            results = [compare(values[first], values[second]) for first, second in pairs]
            corrected = holm([result.p for result in results]).tolist()
            for (first, second), result, p in zip(pairs, results, corrected, strict=True):
                groups = values[first], values[second]
                found.append(Contrast(shape, measure, first, second, groups, result, p))
    return found


def shown_contrasts(found: list[Contrast]) -> list[Contrast]:
    """Return the contrasts for figures and summaries.

    These are all contrasts, or on shapes with more than three types those with the first type.
    """
    types: dict[str, list[ControllerType]] = {}
    for contrast in found:
        of_shape = types.setdefault(contrast.shape, [])
        of_shape += [c for c in (contrast.first, contrast.second) if c not in of_shape]
    return [
        contrast for contrast in found
        if len(types[contrast.shape]) <= _MOST_PAIRED
        or contrast.first == types[contrast.shape][0]
    ]


def contrasts_csv(found: list[Contrast]) -> str:
    """Return the text of statistics.csv, one row per contrast."""
    text = io.StringIO()
    csv.writer(text, lineterminator='\n').writerows([COLUMNS, *contrasts_rows(found)])
    return text.getvalue()


def contrasts_rows(found: list[Contrast]) -> list[tuple]:
    """Return a row of values of `COLUMNS` per contrast."""
    return [
        (
            contrast.shape, contrast.measure, str(contrast.first), str(contrast.second),
            *map(len, contrast.groups), *contrast.medians, contrast.result.u, contrast.result.p,
            contrast.p_holm, contrast.result.a, contrast.result.a_low, contrast.result.a_high,
        )
        for contrast in found
    ]
