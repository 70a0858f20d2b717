"""The `history` command: how runs of `evolve` went or are going, as text and as a figure."""

import argparse
import csv
import shutil
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim_node.errors import InvalidInput
from snca_ros.evolution.checkpoint import HISTORY
from snca_ros.evolution.config import RunConfig
from snca_ros.files import told
from snca_ros.progress import bars

EXAMPLES = """
  snca history runs/tripod                          # how it went, or is going
  snca history runs/tripod --watch                  # drawn again after every generation
  snca history runs/* --figure histories.png
"""

_WIDTH, _HEIGHT = 60, 4  # of a run's chart [characters]
_LOOK_EVERY = 1.0  # s


@dataclass(frozen=True, eq=False)
class History:
    """What `evolve` has written of a run so far.

    Attributes:
        name: of the run, as the user called it.
        rows: (n_generations, 6) columns `HISTORY`, v_x in [m/s]; n_generations may be 0.
        total: evaluations that it will spend; None if only its history is known.
    """

    name: str
    rows: np.ndarray
    total: int | None

    @property
    def evaluations(self) -> int:
        """Return how many are spent."""
        return int(self.rows[-1, 1]) if len(self.rows) else 0

    @property
    def finished(self) -> bool:
        """Return whether nothing more will come."""
        return self.total is None or self.evaluations >= self.total


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `history`."""
    parser.add_argument('runs', nargs='+', type=Path, metavar='RUN',
                        help='run folder of evolve, or a history.csv')
    parser.add_argument('--watch', action='store_true',
                        help='draw again after every generation, until all runs are finished')
    parser.add_argument('--figure', type=Path, metavar='FILE',
                        help='picture to draw, .png, .svg or .pdf')


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Tell and draw histories as the command line says; return the exit code."""
    told: list[str] = []
    live = args.watch and sys.stdout.isatty()
    width = shutil.get_terminal_size().columns if live else None
    while True:
        histories = [read_history(path) for path in args.runs]
        finished = not args.watch or all(history.finished for history in histories)
        lines = [line[:width] for history in histories for line in described(history)]
        if lines != told:
            if args.figure:
                _draw(histories, args.figure)
            if live and told:  # over what stands there
                print(f'\x1b[{len(told)}F\x1b[J', end='')
            if live or finished:
                print('\n'.join(lines), flush=True)
            told = lines
        if finished:
            return 0
        time.sleep(_LOOK_EVERY)


def _draw(histories: Sequence[History], path: Path) -> None:
    from snca_ros.recording.figures import draw_histories, write_figure  # matplotlib loads slowly

    names, tables = [h.name for h in histories], [h.rows for h in histories]
    write_figure(draw_histories(names, tables), path)


def read_history(path: Path) -> History:
    """Return the history of a run folder, or of the CSV file of one.

    Raises:
        InvalidInput: there is none, or it is damaged.
    """
    if path.is_file():
        return History(str(path), _rows(path), None)
    if not (path / 'config.yaml').exists():
        expected = 'the folder of a run of evolve, or its history.csv'
        raise InvalidInput('run', str(path), expected)
    total = RunConfig.from_yaml(path / 'config.yaml').evaluations
    table = path / 'history.csv'
    rows = _rows(table) if table.exists() else np.empty((0, len(HISTORY)))
    return History(str(path), rows, total)


def _rows(path: Path) -> np.ndarray:
    try:
        with path.open(newline='') as file:
            header, *rows = csv.reader(file, strict=True)
        table = np.array(rows, dtype=float).reshape(len(rows), len(HISTORY))
    except (OSError, csv.Error) as error:
        raise InvalidInput('file', told(error), 'the history of a run', str(path)) from None
    except ValueError:
        expected = f'the history of a run: {", ".join(HISTORY)}'
        raise InvalidInput('file', 'other rows', expected, str(path)) from None
    if tuple(header) != HISTORY or not (np.diff(table[:, 1], prepend=0) > 0).all():
        expected = f'rows of {",".join(HISTORY)}, evaluations rising'
        raise InvalidInput('file', f'{len(rows)} rows under {header}', expected, str(path))
    return table


def described(history: History) -> list[str]:
    """Return lines that tell a run: how far it is, and its best v_x so far as a chart."""
    rows = history.rows
    if not len(rows):
        return [f'{history.name}: no generation yet']
    generation, _, best, median, worst, best_so_far = rows[-1]
    of = '' if history.total is None else f' of {history.total}'
    return [
        f'{history.name}: {history.evaluations}{of} evaluations, best {best_so_far:.3f} m/s',
        *bars(rows[:, -1], _WIDTH, _HEIGHT),
        f'generation {generation:.0f}: best {best:.3f}, median {median:.3f}, worst {worst:.3f}',
    ]
