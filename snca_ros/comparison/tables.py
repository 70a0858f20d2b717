"""The tables of a study, with text in all cells."""

from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from snca_ros.comparison.pairwise import Contrast
from snca_ros.comparison.rank_test import LEVEL, quartiles
from snca_ros.comparison.runs import (
    END,
    ENDPOINTS,
    MEASURES,
    OTHER_ENGINE,
    PUSHED,
    ROBUST,
    UNSEEN,
    Cases,
    Run,
    column_of,
    describe_episodes,
    describe_seeds,
    fastest,
    known_measures,
)
from snca_ros.recording.gait import VIBRATION


@dataclass(frozen=True)
class Table:
    """A table: title, header and rows, all rows as long as the header."""

    title: str
    header: list[str]
    rows: list[list[str]]

    def markdown(self) -> str:
        """Return the table in Markdown, its title in bold."""
        lines = [self.header, ['---'] * len(self.header), *self.rows]
        return '\n'.join([f'**{self.title}**', '', *(f'| {" | ".join(line)} |' for line in lines)])


def format_p(p: float) -> str:
    """Return a p-value as text, with a fourth digit if it would otherwise read 0.050."""
    if p < 0.001:
        return '< 0.001'
    return f'{p:.4f}' if f'{p:.3f}' == '0.050' else f'{p:.3f}'


def speeds_table(cases: Cases) -> Table:
    """Return the table of seeds, episodes and speeds of each case."""
    known = [c for c in ENDPOINTS if c != ROBUST or c in known_measures(cases)]
    columns = {**{c: ENDPOINTS[c] for c in known}, 'frequency': 'frequency [Hz]'}
    rows = [
        [shape, str(controller), describe_seeds(runs).split()[0], describe_episodes(runs),
         *(_format_quartiles(runs, column) for column in columns)]
        for shape, of_shape in cases.items() for controller, runs in of_shape.items()
    ]
    header = ['shape', 'controller', 'seeds', 'episodes', *columns.values()]
    return Table('v_x [m/s] of the best controllers: median (quartiles)', header, rows)


def _format_quartiles(runs: list[Run], column: str) -> str:
    values = column_of(runs, column)
    if np.isnan(values).any():
        return '–'
    low, median, high = quartiles(values)
    return f'{median:.2f} ({low:.2f} to {high:.2f})'


def champions_table(cases: Cases) -> Table:
    """Return the table of the best run of each case: the fastest in the mean over pushed starts."""
    columns = {c: ENDPOINTS[c] for c in (END, OTHER_ENGINE, UNSEEN)}
    robust = ROBUST in known_measures(cases)
    rows = []
    for of_shape in cases.values():
        for runs in of_shape.values():
            best = fastest(runs)
            rows.append([
                best.row['run'], *(_format(best.value(column)) for column in columns),
                *_format_starts(best, 'pushed', 'starts'),
                *(_format_starts(best, 'robust', 'robust_starts') if robust else ()),
            ])
    header = ['run', *columns.values(), 'pushed mean ± deviation', 'starts']
    header += ['robust mean ± deviation', 'starts'] if robust else []
    return Table('v_x [m/s] of the fastest of each type over pushed starts', header, rows)


def _format(value: float) -> str:
    return '–' if np.isnan(value) else f'{value:.2f}'


def _format_starts(run: Run, what: str, starts: str) -> tuple[str, str]:
    """Return mean and standard deviation over starts, and the numbers of the starts, as text."""
    mean, std = (run.value(f'v_x_{what}_{of}') for of in ('mean', 'std'))
    return f'{mean:.2f} ± {std:.2f}', run.row[starts].replace('-', ' to ')


VIBRATING_SHARE = 0.5
"""A robot counts as vibrating if a larger share of its actuation's power is above `VIBRATION`."""

SLOWEST = 0.5
"""Smallest pushed mean [m/s] for which the share kept on unseen terrains is meaningful."""

FAST_PEAK = 4.0
"""In the first tables, which lack the share, a robot counts as vibrating if the power of its
actuation peaks above this frequency [Hz]: a voxel contracts and expands within 15 steps."""


def vibrates(run: Run) -> bool:
    """Return whether a run's best controller vibrates."""
    if run.knows_vibration:
        return run.value('vibration') > VIBRATING_SHARE
    return run.value('frequency') > FAST_PEAK


def vibration_table(cases: Cases) -> Table:
    """Return the table of how many runs vibrate, and of the v_x they and the others keep.

    The share kept is v_x on unseen terrains over the pushed mean; its medians omit runs below
    `SLOWEST`. For runs of the first tables only the peak is known, so it decides whether they
    vibrate; if there are any, the share kept is relative to v_x at the end of evolution, of all
    runs that walk forwards.
    """
    rows = []
    all_runs = [run for of_shape in cases.values() for runs in of_shape.values() for run in runs]
    shares = any(run.knows_vibration for run in all_runs)
    known = all(run.knows_vibration for run in all_runs)
    for shape, of_shape in cases.items():
        for controller, runs in of_shape.items():
            fast = [run for run in runs if vibrates(run)]
            slow = [run for run in runs if not vibrates(run)]
            rows.append([
                shape, str(controller),
                *([_format_range(100.0 * column_of(runs, 'vibration'), '.0f')] if shares else ()),
                _format_range(column_of(runs, 'frequency'), '.2f'),
                f'{len(fast)} of {len(runs)}', _format_pace(fast, known), _format_pace(slow, known),
            ])
    vibrating = f'above {FAST_PEAK:g} Hz'
    if shares:
        vibrating = f'above {100 * VIBRATING_SHARE:g} %{"" if known else f" (or {FAST_PEAK:g} Hz)"}'
    header = ['shape', 'controller', *([f'power above {VIBRATION:g} Hz [%]'] if shares else ()),
              'peak [Hz]' if shares else 'frequency [Hz]', vibrating,
              f'{"pushed mean" if known else "v_x"} [m/s] and share kept of those',
              'of the others']
    return Table('Vibration: medians of runs that do and that do not', header, rows)


def _format_range(values: np.ndarray, form: str) -> str:
    if np.isnan(values).any():
        return '–'
    return f'{values.min():{form}} to {values.max():{form}}'


def _format_pace(runs: list[Run], by_pushed: bool) -> str:
    base, least = (PUSHED, SLOWEST) if by_pushed else (END, np.nextafter(0.0, 1.0))
    walked = [run for run in runs if run.value(base) >= least]
    if not walked:
        return '–'
    kept = column_of(walked, UNSEEN) / column_of(walked, base)
    return f'{_median(walked, base):.2f}, {100.0 * quartiles(kept)[1]:.0f} %'


def factors_table(cases: Cases) -> Table:
    """Return the table of how many shapes one architecture or neuron model is better on.

    Better means the larger median. Neuron models are compared within one architecture, and
    architectures with one neuron model.
    """
    measures = known_measures(cases)
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
            larger = [_median(of_shape[first], m) > _median(of_shape[second], m) for m in measures]
            found.setdefault((*names, f'{alike}{first.variant}'), []).append(larger)
    rows = [
        [*names, str(len(larger)), *map(str, np.sum(larger, axis=0))]
        for names, larger in sorted(found.items())
    ]
    header = ['first', 'second', 'with', 'shapes', *measures.values()]
    return Table('On how many shapes the median v_x of the first is the larger', header, rows)


def _median(runs: list[Run], column: str) -> float:
    return float(quartiles(column_of(runs, column))[1])


def contrasts_table(found: list[Contrast]) -> Table:
    """Return the table of p-values and effect sizes of contrasts."""
    header = ['shape', 'v_x', 'first', 'second', 'medians [m/s]', 'p', 'p (Holm)',
              f'A ({100 * LEVEL:g} % interval)']
    rows = []
    for contrast in found:
        result, (first, second) = contrast.result, contrast.medians
        rows.append([
            contrast.shape, MEASURES[contrast.measure],
            str(contrast.first), str(contrast.second), f'{first:.2f}, {second:.2f}',
            format_p(result.p), format_p(contrast.p_holm),
            f'{result.a:.2f} ({result.a_low:.2f} to {result.a_high:.2f})',
        ])
    return Table('First type against second', header, rows)


def titled_list(title: str, lines: list[str]) -> list[str]:
    """Return a Markdown list with a title, as a list of one text; empty if there are no lines."""
    return ['\n'.join([f'**{title}**', '', *(f'- {line}' for line in lines)])] if lines else []
