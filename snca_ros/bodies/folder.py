"""The folder of a search for bodies: search.yaml, controller.npz, bodies.csv, archive.csv, elites.

bodies.csv has all scored bodies, which are the complete state of the search, and is replaced
atomically after each generation; archive.csv and the controller files of elites are derived from
it. So a search that is killed at any moment continues with the same result as if it had not been
stopped.
"""

import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from snca_ros.assessment.trials import summary, write_csv
from snca_ros.bodies.archive import BodySearch, ScoredBody
from snca_ros.bodies.settings import SearchSettings
from snca_ros.controller_file import load_controller, save_controller
from snca_ros.evolution.checkpoint import holds_controller
from snca_ros.files import (
    LOCK,
    hold_folder,
    is_temporary,
    read_csv,
    remove_stale,
    write_text,
)
from snca_ros.trained_controller import TrainedController

SETTINGS, CONTROLLER, BODIES, ARCHIVE = 'search.yaml', 'controller.npz', 'bodies.csv', 'archive.csv'
ELITES = 'size-*-feet-*.npz'
FIGURE = 'archive.png'
"""Default name of the figure."""

COLUMNS = ('generation', 'grid', 'size', 'feet', 'wall_ahead')
"""Columns of bodies.csv, followed by the score from each start; `wall_ahead` is the earliest time
[s] at which the robot met the wall at the end of the ground, empty if it did not."""

ARCHIVE_COLUMNS = ('size', 'feet', 'grid', 'mean', 'std', 'controller')
"""Columns of archive.csv: mean and sample standard deviation are over the starts."""


class SearchFolder:
    """The folder of one search, locked against other processes until it is closed.

    An existing search continues, if settings and controller are the same.

    Args:
        path: the folder; created if it does not exist.
        settings: settings of the search.
        trained: the controller for which bodies are searched.

    Raises:
        InvalidInput: the folder cannot be written, has files that are not of a search, is used by
            another process, or has a search with another controller or other settings.
    """

    def __init__(self, path: Path, settings: SearchSettings, trained: TrainedController) -> None:
        self.path, self.settings, self.trained = path, settings, trained
        self._rows: list[list] = []
        self._written: dict[tuple[int, int], ScoredBody] = {}
        try:
            path.mkdir(parents=True, exist_ok=True)
            # A search that was killed before it wrote search.yaml leaves only these files.
            left = [p for p in path.iterdir() if p.name != LOCK and not is_temporary(p)]
            if left and not (path / SETTINGS).exists():
                expected = 'a new or empty folder, or that of a search'
                raise InvalidInput('out', 'other files in it', expected, str(path))
            self._lock = hold_folder(path, 'search')
            remove_stale(path, (SETTINGS, CONTROLLER, BODIES, ARCHIVE, FIGURE, ELITES))
            try:
                self._begin_or_check()
            except BaseException:
                self.close()
                raise
        except OSError as error:
            reason = 'a file' if path.is_file() else error.strerror
            raise InvalidInput('out', reason, 'a folder that can be written', str(path)) from None

    def _begin_or_check(self) -> None:
        """Write settings and controller, or check that they are what they were."""
        settings, kept = self.path / SETTINGS, self.path / CONTROLLER
        if not settings.exists():
            write_text(settings, self.settings.to_yaml())
        self._check_same_settings(SearchSettings.from_yaml(settings))
        if not kept.exists():
            save_controller(kept, self.trained)
        elif not _is_same_controller(load_controller(kept), self.trained):
            expected = 'the controller with which the search began, in controller.npz'
            raise InvalidInput('controller', 'another controller', expected, str(self.path))

    def _check_same_settings(self, began: SearchSettings) -> None:
        for name, then in vars(began).items():
            if (now := getattr(self.settings, name)) != then:
                expected = f'{then!r}, with which the search began'
                raise InvalidInput(name, now, expected, str(self.path))

    def load(self) -> BodySearch:
        """Return the state of the search; update the files of elites if they are outdated."""
        search = BodySearch(self.settings, self.trained.morphology)
        path = self.path / BODIES
        if path.exists():
            search.tell(self._read(path))
            self._write_derived(search)
        return search

    def _read(self, path: Path) -> list[ScoredBody]:
        header, rows = read_csv(path, 'a table of scored bodies')
        if header != self._columns:
            raise InvalidInput('columns', header, ', '.join(self._columns), str(path))
        found: list[ScoredBody] = []
        for i, row in enumerate(rows):
            try:
                one = _of_row(row)
                if list(map(str, self._row(one))) != row or not self._can_follow(one, found):
                    raise ValueError
            except (ValueError, InvalidInput):
                expected = 'a row as this search has written it'
                raise InvalidInput(f'row {i + 1}', row, expected, str(path)) from None
            found.append(one)
        self._rows = rows
        return found

    def _can_follow(self, one: ScoredBody, before: Sequence[ScoredBody]) -> bool:
        last = before[-1].generation if before else 0
        return (
            len(before) < self.settings.bodies and self.settings.frame.fits(one.body.squares)
            and one.generation in ((last, last + 1) if before else (0,))
        )

    @property
    def _columns(self) -> list[str]:
        return [*COLUMNS, *(f'start_{i}' for i in range(1, 1 + self.settings.starts))]

    def _row(self, one: ScoredBody) -> list:
        wall = '' if one.wall_time is None else repr(one.wall_time)
        return [one.generation, one.body.grid_string, *one.cell, wall, *map(repr, one.scores)]

    def save(self, search: BodySearch) -> None:
        """Write bodies.csv, then archive.csv and the controller files of new elites."""
        self._rows += map(self._row, search.scored[len(self._rows) :])
        write_csv(self.path / BODIES, self._columns, self._rows)
        self._write_derived(search)

    def _write_derived(self, search: BodySearch) -> None:
        elites = search.elites
        write_csv(self.path / ARCHIVE, ARCHIVE_COLUMNS, (
            [*one.cell, one.body.grid_string, repr(one.score), repr(summary(one.scores)[1]),
             self.file_of(one).name]
            for one in elites
        ))
        for one in elites:
            path, trained = self.file_of(one), self.controller(one)
            if self._written.get(one.cell) != one and not holds_controller(path, trained):
                save_controller(path, trained)
            self._written[one.cell] = one

    def file_of(self, one: ScoredBody) -> Path:
        """Return the path of the controller file of an elite."""
        return self.path / f'{one.name}.npz'

    def controller(self, one: ScoredBody) -> TrainedController:
        """Return the controller in a body, with the mean of its scores as fitness."""
        engine = self.settings.engine
        return replace(
            self.trained, morphology=one.body, home=None, terrain=self.settings.terrain,
            fitness=one.score, chosen_by=engine, scores={engine: one.score},
            wall_time=one.wall_time, versions={},
        )

    def close(self) -> None:
        """Release the folder to other processes."""
        self._lock.close()


def _is_same_controller(one: TrainedController, other: TrainedController) -> bool:
    names = 'architecture', 'morphology', 'material', 'solver', 'task'
    return np.array_equal(one.parameters, other.parameters) and all(
        getattr(one, name) == getattr(other, name) for name in names
    )


def _of_row(row: list[str]) -> ScoredBody:
    generation, grid, _, _, wall, *scores = row
    values = tuple(map(float, scores))
    if any(math.isnan(value) for value in values):
        raise ValueError
    wall_time = float(wall) if wall else None
    return ScoredBody(int(generation), parse_morphology(grid), values, wall_time)
