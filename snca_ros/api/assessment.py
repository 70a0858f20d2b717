"""Assessment from Python: scores over terrains, starts and faults, like `snca assess`."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim_node.engine import DEFAULT_ENGINE, check_engine
from sim_node.errors import InvalidInput, check_name
from sim_node.model.terrain import UNSEEN_TERRAINS, parse_terrain
from snca_ros.api.processes import worker_processes
from snca_ros.api.robot import Robot, as_faults, load
from snca_ros.assessment.fault_sweep import parse_sweep
from snca_ros.assessment.running import run_trials
from snca_ros.assessment.trials import (
    FAULTY_STARTS,
    AssessmentOptions,
    all_trials,
    common_task,
)
from snca_ros.cell.models.arithmetic import DEFAULT_ARITHMETIC
from snca_ros.evolution.episode import EPISODE
from snca_ros.evolution.tasks import TASKS, Task
from snca_ros.faults import NO_FAULTS, Faults

DIMS = ('robot', 'faults', 'terrain', 'start')
"""Names of the axes of `Scores`."""


@dataclass(frozen=True, eq=False, repr=False)
class Scores:
    """Scores of episodes by the robots' task, an array with named axes.

    `numpy.asarray` returns `values`.

    Attributes:
        values: (n_robots, n_faults, n_terrains, n_starts); -inf where an episode diverged.
        coords: coordinates of each axis of `DIMS`: names of the robots, texts of the faults ('' for
            none), names of the terrains, and numbers of the starts (0 is the exact one).
        task: task of the robots, which has quantity and unit of the values.
        wall_times: (n_robots, n_faults, n_terrains, n_starts, 2) times [s] at which the robot met
            the wall behind its start, and the wall at the end of the ground; NaN if it did not.
            Scores are measured until the latter.
    """

    values: np.ndarray
    coords: dict[str, tuple]
    task: Task
    wall_times: np.ndarray

    @property
    def v_x(self) -> np.ndarray:
        """Return the `values` [m/s]; InvalidInput if their quantity is not v_x."""
        if self.task.quantity != 'v_x':
            raise InvalidInput('quantity', self.task.quantity, 'v_x; `values` has any quantity')
        return self.values

    @property
    def dims(self) -> tuple[str, ...]:
        """Return the names of the axes, as for `xarray.DataArray(values, coords, dims)`."""
        return DIMS

    def sel(self, **names: object) -> np.ndarray:
        """Return the part of `values` at these coordinates, without their axes.

        Args:
            names: a coordinate for each axis, such as terrain='flat', start=0.

        Raises:
            InvalidInput: there is no such axis or coordinate.
        """
        at: list = [slice(None)] * len(DIMS)
        for dim, name in names.items():
            check_name('axis', dim, DIMS)
            known = self.coords[dim]
            if name not in known:
                raise InvalidInput(dim, name, f'one of {", ".join(map(repr, known))}')
            at[DIMS.index(dim)] = known.index(name)
        return self.values[tuple(at)]

    def __array__(self, dtype=None, copy=None) -> np.ndarray:
        return np.array(self.values, dtype=dtype)

    def __repr__(self) -> str:
        ended = np.isfinite(self.wall_times[..., 1]).sum()
        sizes = ', '.join(f'{dim} {n}' for dim, n in zip(DIMS, self.values.shape, strict=True))
        return (
            f'Scores({sizes}: {self.task.quantity} {self.values.min():.3f} to '
            f'{self.values.max():.3f}, mean {self.task.in_unit(self.values.mean())}'
            f'{f", {ended} met the wall at the end of the ground" if ended else ""})'
        )


def assess(
    robots: Robot | str | Path | Iterable[Robot | str | Path],
    terrains: str | Iterable[str] | None = None,
    starts: int | None = None,
    faults: str | Faults | Iterable[str | Faults] | None = None,
    *,
    engine: str = DEFAULT_ENGINE,
    arithmetic: str = DEFAULT_ARITHMETIC,
    duration: float = EPISODE,
    workers: int = 1,
) -> Scores:
    """Score robots in episodes by the task that they were evolved for, like `snca assess`.

    Args:
        robots: one or several robots of one task, or arguments of `load`.
        terrains: names of terrains; None for the 16 unseen ones, or with faults for that of the
            task.
        starts: number of pushed starts besides the exact one; None for 0, or with faults for 9.
        faults: faults, see docs/robustness.md. One number may be a range, FROM..TO or
            FROM..TO..STEP, such as 'loss=0..0.9..0.1', for several faults.
        engine: one of `sim_node.engine.ENGINES`, such as 'batched'.
        arithmetic: arithmetic of the cells: 'double', or that of firmware, 'float32', 'int16' or
            'int8'.
        duration: duration of an episode [s]; the first 5 s are not scored.
        workers: number of processes, see `evolve`; the result does not depend on it.

    Raises:
        InvalidInput: a value is invalid.
        BrokenExecutor: a worker process ended unexpectedly.
    """
    several = (robots,) if isinstance(robots, (Robot, str, Path)) else tuple(robots)
    loaded = [one if isinstance(one, Robot) else load(one) for one in several]
    all_faults = _all_faults(faults)
    if terrains is None:
        own = dict.fromkeys(TASKS.find(robot.trained.task).terrain for robot in loaded)
        terrains = UNSEEN_TERRAINS if faults is None else own
    grounds = (terrains,) if isinstance(terrains, str) else tuple(terrains)
    if starts is None:
        starts = 0 if faults is None else FAULTY_STARTS
    AssessmentOptions(starts, duration, engine, arithmetic)
    for ground in grounds:
        parse_terrain(ground)
    for robot in loaded:
        check_engine(engine, robot.trained.solver)
    for field, given in (('robots', loaded), ('terrains', grounds), ('faults', all_faults)):
        if not given:
            raise InvalidInput(field, (), 'at least one')
    task = common_task([robot.trained for robot in loaded])
    trials = all_trials(
        [robot.trained.in_arithmetic(arithmetic) for robot in loaded],
        list(all_faults.values()), grounds, engine, 1 + starts, duration,
    )
    with worker_processes(workers) as opened:
        values, walls = run_trials(opened, trials)
    shape = len(loaded), len(all_faults), 1 + starts, len(grounds)
    values, walls = values.reshape(shape).swapaxes(2, 3), walls.reshape(*shape, 2).swapaxes(2, 3)
    names = tuple(robot.name for robot in loaded)
    coords = names, tuple(all_faults), grounds, tuple(range(1 + starts))
    return Scores(values, dict(zip(DIMS, coords, strict=True)), task, walls)


def _all_faults(
    faults: str | Faults | Iterable[str | Faults] | None
) -> dict[str, Faults]:
    """Return the faults by their text, with ranges expanded."""
    if faults is None:
        return {'': NO_FAULTS}
    several = (faults,) if isinstance(faults, (str, Faults)) else tuple(faults)
    found: dict[str, Faults] = {}
    for one in several:
        if isinstance(one, str) and '=' in one and '..' in one:
            sweep = parse_sweep(one)
            found.update(zip(sweep.texts, sweep.faults, strict=True))
        else:
            found[one if isinstance(one, str) else repr(one)] = as_faults(one)
    return found
