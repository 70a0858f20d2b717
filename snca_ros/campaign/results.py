"""The results folder of campaigns: a table with a row per run, histories and controllers."""

import csv
import io
from pathlib import Path

import numpy as np

from sim_node.errors import InvalidInput
from snca_ros.campaign.columns import (
    COLUMNS,
    FORMER_COLUMNS,
    INTEGERS,
    MAY_BE_EMPTY,
    TEXTS,
    with_set,
)
from snca_ros.campaign.endpoints import Outcome
from snca_ros.campaign.first_results import FIRST_COLUMNS, FIRST_INTEGERS, FIRST_TEXTS, converted
from snca_ros.evolution.history import CURVE_COLUMNS, FORMER_CURVE_COLUMNS
from snca_ros.files import hold_folder, read_csv, remove_stale, write_atomically, write_text

_FILES = 'results.csv', 'histories/*.csv', 'controllers/*.npz'


class Results:
    """The results folder of campaigns, locked against other processes until it is closed.

    For each finished run, results.csv has a row, histories/ has a file, and controllers/ has its
    best and its robust controller. A run with a row is finished, whichever campaign it belongs to.

    Raises:
        InvalidInput: the folder cannot be written, is in use, or its table is damaged.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            path.mkdir(parents=True, exist_ok=True)
            self._lock = hold_folder(path, 'results')
        except OSError as error:
            raise _unwritable(path, error) from None
        try:
            table = path / 'results.csv'
            self.rows = {row['run']: row for row in read_rows(table)} if table.exists() else {}
            remove_stale(path, _FILES)
            for folder in ('histories', 'controllers'):
                (path / folder).mkdir(exist_ok=True)
        except OSError as error:
            self._lock.close()
            raise _unwritable(path, error) from None
        except InvalidInput:
            self._lock.close()
            raise

    def add(self, outcome: Outcome) -> None:
        """Write the files of a run, then the table with its row."""
        name = outcome.row['run']
        for suffix, content in (('', outcome.controller), ('-robust', outcome.robust)):
            _write(self.path / 'controllers' / f'{name}{suffix}.npz', content)
        write_text(self.path / 'histories' / f'{name}.csv', outcome.history)
        self.rows[name] = outcome.row
        text = io.StringIO()
        writer = csv.DictWriter(text, COLUMNS, lineterminator='\n')
        writer.writeheader()
        writer.writerows(self.rows[run] for run in sorted(self.rows, key=self._place))
        write_text(self.path / 'results.csv', text.getvalue())

    def _place(self, run: str) -> tuple:
        """Return the sort key of a row, so that the order does not depend on when runs ended."""
        row = self.rows[run]
        case = (row[column] for column in ('shape', 'architecture', 'neuron_model', 'as_printed'))
        return *case, int(row['seed']), run

    def close(self) -> None:
        """Release the folder to other processes."""
        self._lock.close()


def _unwritable(path: Path, error: OSError) -> InvalidInput:
    return InvalidInput('results', error.strerror, 'a folder that can be written', str(path))


def _write(path: Path, content: bytes) -> None:
    write_atomically(path, lambda file: file.write(content))


def read_rows(path: Path) -> list[dict[str, str]]:
    """Return the rows of a results.csv, column to text; those of earlier tables are converted.

    Raises:
        InvalidInput: the file cannot be read, or a row or number in it is damaged.
    """
    header, rows = read_csv(path, 'a table of results')
    if tuple(header) not in _KINDS:
        raise InvalidInput('header', header, ','.join(COLUMNS), str(path))
    seen: set[str] = set()
    for line, cells in enumerate(rows, 2):
        _check_row(cells, header, seen, f'{path}:{line}')
    found = [dict(zip(header, cells, strict=True)) for cells in rows]
    if tuple(header) == FORMER_COLUMNS:
        return [with_set(row) for row in found]
    if tuple(header) == COLUMNS:
        return found
    try:
        return [converted(row) for row in found]
    except InvalidInput as error:
        raise error.found_in(str(path)) from None


_KINDS = {
    COLUMNS: (TEXTS, INTEGERS, MAY_BE_EMPTY),
    FORMER_COLUMNS: (TEXTS, (*INTEGERS, 'evaluations'), MAY_BE_EMPTY),
    FIRST_COLUMNS: (FIRST_TEXTS, FIRST_INTEGERS, ()),
}
"""For each header, its columns with texts, its columns with integers, and those that may be empty.
"""


def _check_row(cells: list[str], header: list[str], seen: set[str], where: str) -> None:
    if len(cells) != len(header):
        raise InvalidInput('row', f'{len(cells)} values', f'{len(header)} values', where)
    if cells[0] in seen:
        raise InvalidInput('run', cells[0], 'one row per run', where)
    seen.add(cells[0])
    texts, integers, may_be_empty = _KINDS[tuple(header)]
    for column, cell in zip(header, cells, strict=True):
        if column in texts or (column in may_be_empty and not cell):
            continue
        kind = int if column in integers else float
        try:
            kind(cell)
        except ValueError:
            expected = 'a whole number' if kind is int else 'a number'
            raise InvalidInput(column, cell, expected, where) from None


def read_curve(path: Path) -> np.ndarray:
    """Return a history, (n_points, 2): episodes and best v_x [m/s] so far.

    Raises:
        InvalidInput: the file cannot be read or is damaged.
    """
    header, rows = read_csv(path, 'the history of a run')
    try:
        points = np.array(rows, dtype=float)
    except ValueError as error:
        raise InvalidInput('file', str(error), 'the history of a run', str(path)) from None
    known = tuple(header) in (CURVE_COLUMNS, FORMER_CURVE_COLUMNS) and points.shape[1:] == (2,)
    if not known or np.isnan(points).any() or not (np.diff(points[:, 0]) >= 0.0).all():
        expected = f'rows of {",".join(CURVE_COLUMNS)} with increasing episodes'
        raise InvalidInput('file', f'{len(rows)} rows under {header}', expected, str(path))
    return points
