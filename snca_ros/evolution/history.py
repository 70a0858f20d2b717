"""Histories of runs of `evolve` and `campaign`: read from files and described as text."""

import contextlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sim_node.errors import InvalidInput
from snca_ros.controller_file import load_controller
from snca_ros.evolution.checkpoint_arrays import FORMER_HISTORY, HISTORY
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.tasks import DEFAULT_TASK, TASKS, Task
from snca_ros.files import read_csv
from snca_ros.progress import bars

CURVE_COLUMNS = ('episodes', 'best_so_far')
"""Columns of a history in the results of a campaign: the best score so far where it changes, and at
the last generation."""

FORMER_CURVE_COLUMNS = ('evaluations', 'best_so_far')
"""The same of earlier versions."""

_WIDTH, _HEIGHT = 60, 4  # of a run's chart [characters]


@dataclass(frozen=True, eq=False)
class History:
    """The history of a run so far.

    Attributes:
        name: path of the run, as the user gave it.
        rows: (n, 6) columns `HISTORY`, a row per generation; of a campaign, a row where the best
            score so far rises, and NaN in the columns that it does not keep. n may be 0.
        total: episodes of the complete run; None if only its history is known.
        task: task of the run; None if there is no configuration of the run beside the history.
        wall_time: time [s] at which the best robot met the wall at the end of the ground; None if
            it did not, or only the history.csv is known.
        finished: whether the run is finished; True if only its history is known.
    """

    name: str
    rows: np.ndarray
    total: int | None
    task: Task | None
    wall_time: float | None = None
    finished: bool = True

    @property
    def label(self) -> str:
        """Return quantity and unit of the scores, such as 'v_x [m/s]'."""
        return self.task.label if self.task else 'fitness'

    @property
    def episodes(self) -> int:
        """Return the number of episodes spent in generations."""
        return int(self.rows[-1, 1]) if len(self.rows) else 0

    @property
    def has_generations(self) -> bool:
        """Return whether the rows are generations; those of a campaign are not."""
        return not np.isnan(self.rows[:, 0]).any()

    def as_dict(self) -> dict[str, object]:
        """Return the history as a dictionary for JSON, with a list of numbers for each column."""
        kept = HISTORY if self.has_generations else CURVE_COLUMNS
        return {
            'run': self.name, 'quantity': self.task.quantity if self.task else None,
            'unit': self.task.unit if self.task else None, 'episodes': self.episodes,
            'total': self.total, 'finished': self.finished,
            'history': {name: self.rows[:, HISTORY.index(name)] for name in kept},
        }


def read_histories(path: Path) -> list[History]:
    """Return the histories of a run, or of all runs in the results folder of campaigns.

    Raises:
        InvalidInput: there is none, or one is damaged.
    """
    folder = path / 'histories' if (path / 'histories').is_dir() else path
    files = sorted(folder.glob('*.csv'))
    if folder.is_dir() and files and not (folder / 'config.yaml').exists():
        return [read_history(file) for file in files]
    return [read_history(path)]


def read_history(path: Path) -> History:
    """Return the history of a run from its folder or from a file, also one of a campaign.

    Raises:
        InvalidInput: there is none, or it is damaged.
    """
    if path.is_file():
        found = History(str(path), _rows(path), None, _task_beside(path))
        # Campaigns evolve for the default task only.
        return found if found.has_generations else replace(found, task=TASKS.find(DEFAULT_TASK))
    if not (path / 'config.yaml').exists():
        expected = 'the folder of a run of evolve, its history.csv, or a results folder'
        raise InvalidInput('run', str(path), expected)
    config = RunConfig.from_yaml(path / 'config.yaml')
    table = path / 'history.csv'
    rows = _rows(table) if table.exists() else np.empty((0, len(HISTORY)))
    best = load_controller(path / 'best.npz') if (path / 'best.npz').exists() else None
    spent = int(rows[-1, 1]) if len(rows) else 0
    finished = not config.room(spent)
    if config.draw:  # it is when the best is chosen, by further episodes
        finished = finished and best is not None and best.evaluations > spent
    return History(
        str(path), rows, config.episodes, TASKS.find(config.task),
        best.wall_time if best else None, finished,
    )


def _task_beside(path: Path) -> Task | None:
    """Return the task in the configuration beside a history file, None if there is none."""
    for config in (path.with_name('config.yaml'), path.with_suffix('.yaml')):
        with contextlib.suppress(InvalidInput):
            return TASKS.find(RunConfig.from_yaml(config).task)
    return None


def _rows(path: Path) -> np.ndarray:
    header, rows = read_csv(path, 'the history of a run')
    is_curve = tuple(header) in (CURVE_COLUMNS, FORMER_CURVE_COLUMNS)
    try:
        table = np.full((len(rows), len(HISTORY)), np.nan)
        at = [HISTORY.index(name) for name in CURVE_COLUMNS] if is_curve else slice(None)
        table[:, at] = np.array(rows, dtype=float).reshape(len(rows), len(header))
    except ValueError:
        expected = f'the history of a run: {", ".join(HISTORY)}'
        raise InvalidInput('file', 'other columns or values', expected, str(path)) from None
    is_known = is_curve or tuple(header) in (HISTORY, FORMER_HISTORY)
    if not is_known or not (np.diff(table[:, 1], prepend=0) > 0).all():
        expected = f'rows of {",".join(HISTORY)} with increasing episodes'
        raise InvalidInput('file', f'{len(rows)} rows under {header}', expected, str(path))
    return table


def describe(history: History) -> list[str]:
    """Return lines that describe a run: its progress, and its best score so far as a chart."""
    rows = history.rows
    if not len(rows):
        return [f'{history.name}: no generation yet']
    generation, _, best, median, worst, best_so_far = rows[-1]
    in_unit = history.task.in_unit if history.task else '{:.3f}'.format
    of = '' if history.total is None else f' of {history.total}'
    head = f'{history.name}: {history.episodes}{of} episodes, best {in_unit(best_so_far)}'
    if history.wall_time is not None:
        head += f', which met the wall at the end of the ground at {history.wall_time:.2f} s'
    if not history.has_generations:
        points = np.linspace(rows[0, 1], rows[-1, 1], _WIDTH)
        at_points = rows[np.searchsorted(rows[:, 1], points, side='right') - 1, -1]
        return [head, *bars(at_points, _WIDTH, _HEIGHT)]
    return [
        head,
        *bars(rows[:, -1], _WIDTH, _HEIGHT),
        f'generation {generation:.0f}: best {best:.3f}, median {median:.3f}, worst {worst:.3f}',
    ]
