"""What a study finds as tables of text, in Markdown."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from snca_ros.study.cases import (
    MEASURES,
    OTHER_ENGINE,
    OWN_ENGINE,
    Cases,
    Run,
    column_of,
    fastest,
    told_evaluations,
    told_seeds,
)
from snca_ros.study.contrasts import Contrast
from snca_ros.study.statistics import LEVEL, quartiles


@dataclass(frozen=True)
class Table:
    """A table: what it is of, its header and its rows, all of the same length."""

    title: str
    header: list[str]
    rows: list[list[str]]

    def markdown(self) -> str:
        """Return the table in Markdown, its title in bold."""
        lines = [self.header, ['---'] * len(self.header), *self.rows]
        return '\n'.join([f'**{self.title}**', '', *(f'| {" | ".join(line)} |' for line in lines)])


def told_p(p: float) -> str:
    """Return a p-value as text, with one more digit where it would read like 0.05 itself."""
    if p < 0.001:
        return '< 0.001'
    return f'{p:.4f}' if f'{p:.3f}' == '0.050' else f'{p:.3f}'


def speeds_table(cases: Cases) -> Table:
    """Return seeds, evaluations and speeds of each case."""
    columns = {
        OWN_ENGINE: 'end of evolution', OTHER_ENGINE: 'other engine',
        'v_x_starts_mean': 'pushed starts', 'v_x_unseen': 'unseen terrains',
        'frequency': 'frequency [Hz]',
    }
    rows = [
        [shape, str(controller), told_seeds(runs).split()[0], told_evaluations(runs),
         *(_told_quartiles(runs, column) for column in columns)]
        for shape, of_shape in cases.items() for controller, runs in of_shape.items()
    ]
    header = ['shape', 'controller', 'seeds', 'evaluations', *columns.values()]
    return Table('v_x [m/s] of the best controllers: median (quartiles)', header, rows)


def _told_quartiles(runs: list[Run], column: str) -> str:
    low, median, high = quartiles(column_of(runs, column))
    return f'{median:.2f} ({low:.2f} to {high:.2f})'


def champions_table(cases: Cases) -> Table:
    """Return the best controller of each case: the fastest in the mean over pushed starts."""
    columns = {
        OWN_ENGINE: 'end of evolution', OTHER_ENGINE: 'other engine',
        'v_x_unseen': 'unseen terrains',
    }
    rows = []
    for of_shape in cases.values():
        for runs in of_shape.values():
            best = fastest(runs)
            mean, std = (best.value(f'v_x_starts_{what}') for what in ('mean', 'std'))
            rows.append([
                best.row['run'], *(f'{best.value(column):.2f}' for column in columns),
                f'{mean:.2f} ± {std:.2f}', best.row['starts'],
            ])
    header = ['run', *columns.values(), 'pushed starts: mean ± deviation', 'starts']
    return Table('v_x [m/s] of the fastest of each type over pushed starts', header, rows)


VIBRATION = 4.0
"""Dominant frequency of the actuation [Hz] above which a robot counts as vibrating: a voxel
contracts and expands again in less than 15 control steps."""


def vibration_table(cases: Cases) -> Table:
    """Return how many runs of each case vibrate, and what those and the others keep of v_x.

    Kept is the share of v_x at the end of evolution that is left on unseen terrains. Runs whose
    robots do not walk forwards are left out of the medians.
    """
    rows = []
    for shape, of_shape in cases.items():
        for controller, runs in of_shape.items():
            frequency = column_of(runs, 'frequency')
            fast = [run for run in runs if run.value('frequency') > VIBRATION]
            slow = [run for run in runs if not run.value('frequency') > VIBRATION]
            rows.append([
                shape, str(controller), f'{frequency.min():.2f} to {frequency.max():.2f}',
                f'{len(fast)} of {len(runs)}', _told_pace(fast), _told_pace(slow),
            ])
    header = ['shape', 'controller', 'frequency [Hz]', f'above {VIBRATION:g} Hz',
              'v_x [m/s] and share kept of those', 'of the others']
    return Table('Vibration: medians of runs that do and that do not', header, rows)


def _told_pace(runs: list[Run]) -> str:
    walked = [run for run in runs if run.value(OWN_ENGINE) > 0.0]
    if not walked:
        return '–'
    kept = column_of(walked, 'v_x_unseen') / column_of(walked, OWN_ENGINE)
    return f'{_median(walked, OWN_ENGINE):.2f}, {100.0 * quartiles(kept)[1]:.0f} %'


def factors_table(cases: Cases) -> Table:
    """Return in how many shapes one architecture, or one neuron model, has the larger median.

    All else is alike: neuron models are compared in one architecture, and the other way round.
    """
    found: dict[tuple[str, str, str], list[list[bool]]] = {}
    for of_shape in cases.values():
        for first, second in combinations(of_shape, 2):
            if second == replace(first, architecture=second.architecture):
                alike = first.neuron_model.upper()
                names = first.architecture, second.architecture
            elif second == replace(first, neuron_model=second.neuron_model):
                alike = first.architecture
                names = first.neuron_model.upper(), second.neuron_model.upper()
            else:
                continue
            larger = [_median(of_shape[first], m) > _median(of_shape[second], m) for m in MEASURES]
            found.setdefault((*names, f'{alike}{first.variant}'), []).append(larger)
    rows = [
        [*names, str(len(larger)), *map(str, np.sum(larger, axis=0))]
        for names, larger in sorted(found.items())
    ]
    header = ['first', 'second', 'with', 'shapes', *MEASURES.values()]
    return Table('On how many shapes the median v_x of the first is the larger', header, rows)


def _median(runs: list[Run], column: str) -> float:
    return float(quartiles(column_of(runs, column))[1])


def contrasts_table(found: list[Contrast]) -> Table:
    """Return p-values and effect sizes of contrasts."""
    header = ['shape', 'v_x', 'first', 'second', 'medians [m/s]', 'p', 'p (Holm)',
              f'A ({100 * LEVEL:g} % interval)']
    rows = []
    for contrast in found:
        result, (first, second) = contrast.result, contrast.medians
        rows.append([
            contrast.shape, MEASURES[contrast.measure],
            str(contrast.first), str(contrast.second), f'{first:.2f}, {second:.2f}',
            told_p(result.p), told_p(contrast.p_holm),
            f'{result.a:.2f} ({result.a_low:.2f} to {result.a_high:.2f})',
        ])
    return Table('First type against second', header, rows)


def told_lines(title: str, lines: list[str]) -> list[str]:
    """Return a Markdown list under a title; nothing if there are no lines."""
    return ['\n'.join([f'**{title}**', '', *(f'- {line}' for line in lines)])] if lines else []
