"""Histories of runs of `evolve`: read from files and described as text."""

import contextlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim_node.errors import InvalidInput
from snca_ros.controller_file import load_controller
from snca_ros.evolution.checkpoint_arrays import HISTORY
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.tasks import TASKS, Task
from snca_ros.files import read_csv
from snca_ros.progress import bars

_WIDTH, _HEIGHT = 60, 4  # of a run's chart [characters]


@dataclass(frozen=True, eq=False)
class History:
    """The history of a run so far.

    Attributes:
        name: path of the run, as the user gave it.
        rows: (n_generations, 6) columns `HISTORY`; n_generations may be 0.
        total: evaluations of the complete run; None if only its history.csv is known.
        task: task of the run; None if there is no configuration of the run beside the history.
        wall_time: time [s] at which the best robot met the wall at the end of the ground; None if
            it did not, or only the history.csv is known.
    """

    name: str
    rows: np.ndarray
    total: int | None
    task: Task | None
    wall_time: float | None = None

    @property
    def label(self) -> str:
        """Return quantity and unit of the scores, such as 'v_x [m/s]'."""
        return self.task.label if self.task else 'fitness'

    @property
    def evaluations(self) -> int:
        """Return the number of evaluations spent."""
        return int(self.rows[-1, 1]) if len(self.rows) else 0

    @property
    def finished(self) -> bool:
        """Return whether the run is finished; True if its total is not known."""
        return self.total is None or self.evaluations >= self.total


def read_history(path: Path) -> History:
    """Return the history of a run from its folder or from a history.csv.

    Raises:
        InvalidInput: there is none, or it is damaged.
    """
    if path.is_file():
        return History(str(path), _rows(path), None, _task_beside(path))
    if not (path / 'config.yaml').exists():
        expected = 'the folder of a run of evolve, or its history.csv'
        raise InvalidInput('run', str(path), expected)
    config = RunConfig.from_yaml(path / 'config.yaml')
    table = path / 'history.csv'
    rows = _rows(table) if table.exists() else np.empty((0, len(HISTORY)))
    best = path / 'best.npz'
    wall_time = load_controller(best).wall_time if best.exists() else None
    return History(str(path), rows, config.evaluations, TASKS.find(config.task), wall_time)


def _task_beside(path: Path) -> Task | None:
    """Return the task in the configuration beside a history file, None if there is none."""
    for config in (path.with_name('config.yaml'), path.with_suffix('.yaml')):
        with contextlib.suppress(InvalidInput):
            return TASKS.find(RunConfig.from_yaml(config).task)
    return None


def _rows(path: Path) -> np.ndarray:
    header, rows = read_csv(path, 'the history of a run')
    try:
        table = np.array(rows, dtype=float).reshape(len(rows), len(HISTORY))
    except ValueError:
        expected = f'the history of a run: {", ".join(HISTORY)}'
        raise InvalidInput('file', 'other columns or values', expected, str(path)) from None
    if tuple(header) != HISTORY or not (np.diff(table[:, 1], prepend=0) > 0).all():
        expected = f'rows of {",".join(HISTORY)} with increasing evaluations'
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
    time = history.wall_time
    wall = '' if time is None else f', which met the wall at the end of the ground at {time:.2f} s'
    return [
        f'{history.name}: {history.evaluations}{of} evaluations, best {in_unit(best_so_far)}{wall}',
        *bars(rows[:, -1], _WIDTH, _HEIGHT),
        f'generation {generation:.0f}: best {best:.3f}, median {median:.3f}, worst {worst:.3f}',
    ]
