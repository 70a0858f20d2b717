"""The finished runs of campaigns, grouped by shape and type of controller."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sim_node.engine import ENGINES
from sim_node.errors import InvalidInput, check_name
from sim_node.model.physics import PHYSICS
from sim_node.model.terrain import TERRAIN_SETS
from snca_ros.campaign.columns import OF_SET, unusual_cell
from snca_ros.campaign.results import read_rows
from snca_ros.campaign.specification import read_campaign
from snca_ros.cell.architecture import ARCHITECTURES
from snca_ros.cell.models import NEURON_MODELS
from snca_ros.evolution.strategies import STRATEGIES

END, OTHER_ENGINE, UNSEEN = 'v_x_end', 'v_x_other', 'v_x_unseen'
PUSHED, ROBUST = 'v_x_pushed_mean', 'v_x_robust_mean'
"""Columns of the endpoints [m/s]; see docs/campaigns.md."""

ENDPOINTS = {
    END: 'end of evolution', OTHER_ENGINE: 'other engine', PUSHED: 'pushed mean',
    UNSEEN: 'unseen terrains', ROBUST: 'robust',
}
"""Columns of the endpoints and their names in tables."""

MEASURES = {column: ENDPOINTS[column] for column in (END, UNSEEN, PUSHED, ROBUST)}
"""Columns in which types of controllers are compared, and their names in tables."""

FEWEST_SEEDS = 3
"""Number of seeds below which a case has a warning."""

_NUMBERS = 'substeps', 'iterations', 'population', 'sigma', 'duration', 'transient'


@dataclass(frozen=True)
class ControllerType:
    """A type of controller, the paper's embodied NCA: an architecture and a neuron model.

    Attributes:
        architecture, neuron_model, as_printed: see `Architecture`.
        settings: settings in which its runs differ from other runs: engine, terrain, ...
    """

    architecture: str
    neuron_model: str
    as_printed: bool = False
    settings: str = ''

    def __str__(self) -> str:
        """Return the paper's name of the type, such as 'U-nD SNN-H'."""
        return f'{self.architecture} {self.neuron_model.upper()}{self.variant}'

    @property
    def variant(self) -> str:
        """Return the end of the name: what differs besides architecture and neuron model."""
        printed = ' as printed' if self.as_printed else ''
        settings = f', {self.settings}' if self.settings else ''
        return f'{printed}{settings}'

    @property
    def order(self) -> tuple[bool, int, int, str]:
        """Return the sort key of types: the paper's own type comes first."""
        model = list(NEURON_MODELS).index(self.neuron_model)
        return self.as_printed, ARCHITECTURES.index(self.architecture), -model, self.settings


@dataclass(frozen=True)
class Run:
    """A finished run: its row of results.csv, column to text, and the file of its history."""

    row: dict[str, str]
    history: Path

    @property
    def controller(self) -> ControllerType:
        """Return the type of the run's controller, without settings."""
        row = self.row
        return ControllerType(row['architecture'], row['neuron_model'], row['as_printed'] == 'true')

    @property
    def episodes(self) -> int:
        """Return the number of episodes of the run."""
        return int(self.row['episodes'])

    @property
    def settings(self) -> list[str]:
        """Return the settings besides case, budget and seed, one word each: terrain, engine, ..."""
        row = self.row
        collides = {'false': [], 'true': ['self-collision']}.get(
            row['self_collision'], [f'self-collision-{row["self_collision"]}']
        )
        return [
            row['terrain'], row['engine'], row['strategy'], f'{row["physics"]}-physics',
            f'unseen-{row["terrain_set"]}', *(f'{name}{row[name]}' for name in _NUMBERS),
            *collides, *(f'{name}-{row[name]}' for name in OF_SET), *unusual_cell(row),
        ]

    def value(self, column: str) -> float:
        """Return the number in a column of the run's row; NaN if it is not known."""
        return float(self.row[column] or 'nan')

    @property
    def knows_vibration(self) -> bool:
        """Return whether the share of vibration is known; the first tables do not have it."""
        return not np.isnan(self.value('vibration'))


Cases = dict[str, dict[ControllerType, list[Run]]]
"""Runs by shape and type of controller, at least one for each type."""


def read_cases(folders: Sequence[Path], campaigns: Sequence[Path] = ()) -> Cases:
    """Return the runs of all results folders, each once.

    Args:
        folders: results folders.
        campaigns: campaign files; if there are any, only their runs are returned.

    Raises:
        InvalidInput: a table is missing or damaged, there is no run, two tables do not agree, or
            a campaign file is invalid.
    """
    runs: dict[str, Run] = {}
    wanted = {config.name for path in campaigns for config in read_campaign(path)}
    for folder in folders:
        table = folder / 'results.csv'
        for row in read_rows(table):
            _check_row(row, str(table))
            if campaigns and row['run'] not in wanted:
                continue
            run = Run(row, folder / 'histories' / f'{row["run"]}.csv')
            known = runs.setdefault(row['run'], run)
            if known.row != row:
                expected = f'the same row as in {known.history.parents[1] / "results.csv"}'
                raise InvalidInput('run', row['run'], expected, str(table))
    if not runs:
        shown = ', '.join(map(str, folders))
        of = f' of {", ".join(map(str, campaigns))}' if campaigns else ''
        raise InvalidInput('results', shown, f'at least one finished run{of}')
    common = set.intersection(*(set(run.settings) for run in runs.values()))
    found: dict[tuple[str, ControllerType], list[Run]] = {}
    for run in runs.values():
        differing = ' '.join(word for word in run.settings if word not in common)
        controller = replace(run.controller, settings=differing)
        found.setdefault((run.row['shape'], controller), []).append(run)
    cases: Cases = {}
    for shape, controller in sorted(found, key=lambda case: (case[0], case[1].order)):
        cases.setdefault(shape, {})[controller] = found[shape, controller]
    return cases


def _check_row(row: dict[str, str], table: str) -> None:
    known = {
        'architecture': ARCHITECTURES, 'neuron_model': NEURON_MODELS, 'engine': ENGINES,
        'chosen_by': ENGINES, 'as_printed': ('true', 'false'), 'strategy': STRATEGIES,
        'physics': PHYSICS, 'terrain_set': TERRAIN_SETS,
    }
    for column, values in known.items():
        check_name(column, row[column], values, table)
    try:
        unusual_cell(row)
    except InvalidInput as error:
        raise error.found_in(table) from None
    for column in (END, UNSEEN, PUSHED, *(c for c in (OTHER_ENGINE, ROBUST) if row[c])):
        if np.isnan(float(row[column])):
            raise InvalidInput(column, row[column], 'a speed, or -inf', table)


def fastest(runs: Sequence[Run]) -> Run:
    """Return the run whose best controller is the fastest in the mean over pushed starts."""
    return max(runs, key=lambda run: run.value(PUSHED))


def known_measures(cases: Cases) -> dict[str, str]:
    """Return the `MEASURES` that all runs have; the first tables have no robust controller."""
    runs = [run for of_shape in cases.values() for of in of_shape.values() for run in of]
    return {c: name for c, name in MEASURES.items() if not np.isnan(column_of(runs, c)).any()}


def column_of(runs: Sequence[Run], column: str) -> np.ndarray:
    """Return the values of runs in a column, (n_runs,); NaN where they are not known."""
    return np.array([run.value(column) for run in runs])


def controller_types(cases: Cases) -> list[ControllerType]:
    """Return the types of all shapes, in order."""
    types = {controller for of_shape in cases.values() for controller in of_shape}
    return sorted(types, key=lambda controller: controller.order)


def missing_runs(cases: Cases, campaigns: Sequence[Path]) -> list[str]:
    """Return lines that name the cases with missing runs.

    Expected are the runs of the campaign files; without files, each type of controller on each
    shape.
    """
    expected: Counter[tuple[str, ControllerType]] = Counter()
    done: Counter[tuple[str, ControllerType]] = Counter()
    names = {run.row['run'] for of in cases.values() for runs in of.values() for run in runs}
    for config in {c.name: c for path in campaigns for c in read_campaign(path)}.values():
        cell = config.architecture
        case = config.shape, ControllerType(cell.name, cell.neuron_model, cell.as_printed)
        expected[case] += 1
        done[case] += config.name in names
    if not campaigns:
        types = controller_types(cases)
        expected = Counter((shape, controller) for shape in cases for controller in types)
        done = Counter((shape, controller) for shape in cases for controller in cases[shape])
    lacking: dict[str, list[str]] = {}
    for case in sorted(expected, key=lambda case: (case[0], case[1].order)):
        n, wanted = done[case], expected[case]
        if n < wanted:
            so_far = f'only {n} of {wanted} runs' if n else 'no run yet'
            lacking.setdefault(f'{case[0]}: {so_far}', []).append(str(case[1]))
    return [f'{state} of {", ".join(types)}' for state, types in lacking.items()]


def warnings(cases: Cases) -> list[str]:
    """Return lines that describe why a comparison may be misleading."""
    lines = []
    for shape, of_shape in cases.items():
        for controller, runs in of_shape.items():
            if len(runs) < FEWEST_SEEDS:
                seeds = describe_seeds(runs)
                lines.append(f'{shape}, {controller}: {seeds}, too few for a conclusion')
            diverged = sum(any(np.isinf(run.value(m)) for m in MEASURES) for run in runs)
            if diverged:
                lines.append(f'{shape}, {controller}: {diverged} of {len(runs)} runs diverged in '
                             'an episode; they count as slowest, and figures omit them')
        everything = [run for runs in of_shape.values() for run in runs]
        if len({run.episodes for run in everything}) > 1:
            lines.append(f'{shape}: unequal budgets: {evidence(of_shape)}')
        settings = sorted({controller.settings or 'defaults' for controller in of_shape})
        if len(settings) > 1:
            lines.append(f'{shape}: runs of unequal settings: {", ".join(settings)}')
    return lines


def describe_seeds(runs: Sequence[Run]) -> str:
    """Return the number of seeds of runs as text."""
    n = len({run.row['seed'] for run in runs})
    return f'{n} seed{"s" * (n != 1)}'


def describe_episodes(runs: Sequence[Run]) -> str:
    """Return the episodes per run as text: a number, or the smallest and the largest."""
    spent = [run.episodes for run in runs]
    least, most = min(spent), max(spent)
    return f'{least:,}' if least == most else f'{least:,} to {most:,}'


def evidence(of_shape: dict[ControllerType, list[Run]]) -> str:
    """Return the numbers of seeds and episodes of each type of controller, as text."""
    types: dict[str, list[str]] = {}
    for controller, runs in of_shape.items():
        spent = f'{describe_seeds(runs)} × {describe_episodes(runs)} episodes'
        types.setdefault(spent, []).append(str(controller))
    return '; '.join(f'{spent} of {", ".join(names)}' for spent, names in types.items())
