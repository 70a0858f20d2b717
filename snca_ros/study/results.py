"""What a campaign finds: a row per run, its history and its best controller, in one folder."""

import csv
import io
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.simulation import Diverged
from sim_node.solver import ENGINES
from sim_node.stamps import CONTROL_RATE
from sim_node.terrain import UNSEEN_TERRAINS
from snca_ros.controller_file import load_controller
from snca_ros.evolution.checkpoint import Progress, RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.workers import IN_PROCESS
from snca_ros.files import hold_folder, told, write_atomically, write_text
from snca_ros.study.assess import Trial, score, summary
from snca_ros.study.gait import dominant_frequency, steady_part

STARTS = 20
"""Pushed starts from which a run's best controller is scored."""

COLUMNS = (
    'run', 'shape', 'architecture', 'neuron_model', 'as_printed', 'seed', 'engine',
    'n_evaluations', 'v_x', 'chosen_by', *(f'v_x_{engine}' for engine in ENGINES),
    'v_x_unseen', *UNSEEN_TERRAINS, 'starts', 'v_x_starts_mean', 'v_x_starts_std', 'frequency',
)
"""Of results.csv; speeds are [m/s] of the best controller, the frequency [Hz] of its actuation."""

CURVE_COLUMNS = ('evaluations', 'best_so_far')
"""Of a history: where the best v_x [m/s] so far rises, and the last generation."""

_TEXTS = ('run', 'shape', 'architecture', 'neuron_model', 'as_printed', 'engine', 'chosen_by')


@dataclass(frozen=True)
class Outcome:
    """What a run found.

    Attributes:
        row: of results.csv, column to text.
        history: text of the CSV of its best-so-far curve.
        controller: content of its best.npz.
    """

    row: dict[str, str]
    history: str
    controller: bytes


def perform(config: RunConfig, path: Path) -> Outcome:
    """Evolve the run of the run folder `path`, or go on with it; then assess the best controller.

    All in this process, and the same whether it was stopped on the way or not.
    """
    folder = RunFolder.create_or_resume(path, config)
    try:
        progress = evolve(folder, IN_PROCESS)
        return Outcome(_row(config, path), _curve(progress), (path / 'best.npz').read_bytes())
    finally:
        folder.close()


def _row(config: RunConfig, path: Path) -> dict[str, str]:
    best, cell = load_controller(path / 'best.npz'), config.architecture
    own = Trial(best, config.terrain, duration=config.duration, transient=config.transient)
    unseen = [score(replace(own, terrain=terrain)) for terrain in UNSEEN_TERRAINS]
    mean, deviation = summary([score(replace(own, start=1 + i)) for i in range(STARTS)])
    values = (
        config.name, config.shape, cell.name, cell.neuron_model, str(cell.as_printed).lower(),
        config.seed, config.engine, best.evaluations, best.fitness, best.chosen_by,
        *(score(replace(own, engine=engine)) for engine in ENGINES),
        summary(unseen)[0], *unseen, STARTS, mean, deviation, _frequency(own),
    )
    return dict(zip(COLUMNS, map(str, values), strict=True))


def _frequency(trial: Trial) -> float:
    """Return the dominant frequency [Hz] of the actuation in an episode."""
    simulation, controller = trial.simulation(), trial.trained.controller()
    readings, actuation = simulation.reset(), []
    try:
        for _ in range(round(trial.duration * CONTROL_RATE)):
            actuation.append(controller.step(readings))
            readings = simulation.step(actuation[-1])
    except Diverged:
        pass
    return dominant_frequency(steady_part(np.array(actuation), trial.transient))


def _curve(progress: Progress) -> str:
    """Return the generations in which the best so far rises, and the last, as CSV."""
    lines = [','.join(CURVE_COLUMNS)]
    last = -np.inf
    for _, evaluations, *_, best_so_far in progress.history:
        if best_so_far > last or evaluations == progress.evaluations:
            lines.append(f'{int(evaluations)},{best_so_far!r}')
        last = best_so_far
    return '\n'.join([*lines, ''])


class Results:
    """The results folder, held against a second process while it is open; close it when done.

    results.csv has a row per finished run; histories/ and controllers/ a file each. A run that
    has its row is finished, whichever campaign it belongs to.

    Raises:
        InvalidInput: the folder cannot be written, is in use, or its table is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            for folder in ('histories', 'controllers'):
                (path / folder).mkdir(parents=True, exist_ok=True)
            self._lock = hold_folder(path, 'results')
        except OSError as error:
            expected = 'a folder that can be written'
            raise InvalidInput('results', error.strerror, expected, str(path)) from None
        try:
            table = path / 'results.csv'
            self.rows = {row['run']: row for row in read_rows(table)} if table.exists() else {}
        except InvalidInput:
            self._lock.close()
            raise

    def add(self, outcome: Outcome) -> None:
        """Write the files of a run, then the table with its row."""
        name = outcome.row['run']
        write_atomically(
            self.path / 'controllers' / f'{name}.npz', lambda file: file.write(outcome.controller)
        )
        write_text(self.path / 'histories' / f'{name}.csv', outcome.history)
        self.rows[name] = outcome.row
        text = io.StringIO()
        writer = csv.DictWriter(text, COLUMNS, lineterminator='\n')
        writer.writeheader()
        writer.writerows(self.rows[run] for run in sorted(self.rows, key=self._place))
        write_text(self.path / 'results.csv', text.getvalue())

    def _place(self, run: str) -> tuple:
        """Return what orders the table: it must not depend on which run ended first."""
        row = self.rows[run]
        case = (row[column] for column in ('shape', 'architecture', 'neuron_model', 'as_printed'))
        return *case, int(row['seed']), run

    def close(self) -> None:
        """Let another process have the folder."""
        self._lock.close()


def read_rows(path: Path) -> list[dict[str, str]]:
    """Return the rows of a results.csv, column to text.

    Raises:
        InvalidInput: it cannot be read, or a row or number of it is damaged.
    """
    try:
        with path.open(newline='') as file:
            header, *rows = csv.reader(file, strict=True)
    except (OSError, ValueError, csv.Error) as error:
        raise InvalidInput('file', told(error), 'a table of results', str(path)) from None
    if tuple(header) != COLUMNS:
        raise InvalidInput('header', header, ','.join(COLUMNS), str(path))
    seen: set[str] = set()
    for line, cells in enumerate(rows, 2):
        _check_row(cells, seen, f'{path}:{line}')
    return [dict(zip(COLUMNS, cells, strict=True)) for cells in rows]


def _check_row(cells: list[str], seen: set[str], where: str) -> None:
    if len(cells) != len(COLUMNS):
        raise InvalidInput('row', f'{len(cells)} values', f'{len(COLUMNS)} values', where)
    if cells[0] in seen:
        raise InvalidInput('run', cells[0], 'a run that has no other row', where)
    seen.add(cells[0])
    for column, cell in zip(COLUMNS, cells, strict=True):
        kind = int if column in ('seed', 'n_evaluations', 'starts') else float
        try:
            _ = column in _TEXTS or kind(cell)
        except ValueError:
            raise InvalidInput(column, cell, 'a number', where) from None


def read_curve(path: Path) -> np.ndarray:
    """Return a history, (n_points, 2): evaluations and best v_x [m/s] so far.

    Raises:
        InvalidInput: it cannot be read or is damaged.
    """
    try:
        with path.open(newline='') as file:
            header, *rows = csv.reader(file, strict=True)
        points = np.array(rows, dtype=float)
    except (OSError, ValueError, csv.Error) as error:
        raise InvalidInput('file', str(error), 'the history of a run', str(path)) from None
    rising = (np.diff(points, axis=0) >= 0.0).all() and not np.isnan(points).any()
    if tuple(header) != CURVE_COLUMNS or points.shape[1:] != (2,) or not rising:
        expected = f'rows of rising {",".join(CURVE_COLUMNS)}'
        raise InvalidInput('file', f'{len(rows)} rows under {header}', expected, str(path))
    return points
