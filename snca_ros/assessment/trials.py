"""Trials: episodes of trained controllers on any terrain, from pushed starts, with faults."""

import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from sim_node.control_time import CONTROL_RATE, steps_in
from sim_node.engine import DEFAULT_ENGINE, ENGINES
from sim_node.errors import InvalidInput
from sim_node.model.constants import check_declared, choice, constant
from sim_node.model.terrain import MOST_TERRAIN_SEEDS
from sim_node.numerics.jit import warm_up
from sim_node.simulation import Simulation
from snca_ros.cell.models.arithmetic import ARITHMETICS, DEFAULT_ARITHMETIC
from snca_ros.evolution.episode import EPISODE, LONGEST, TRANSIENT, Episode, run_episode
from snca_ros.evolution.tasks import Scored, Task, check_task, score_of
from snca_ros.faults import NO_FAULTS, Faults
from snca_ros.files import write_text
from snca_ros.trained_controller import TrainedController

WALLS = ('wall_behind', 'wall_ahead')
"""Columns of times [s] at which the robot met the wall behind its start, and the wall at the end of
the ground; empty if it did not."""

COLUMNS = ('controller', 'terrain', 'engine', 'start', *WALLS)
"""Columns of the CSV file, one row per episode; the last column is the score, named after the
task's quantity. Start 0 is the exact one, the others are pushed. For each start, a row of a kind of
terrain has the mean over its seeds, and a row `MEAN` has the mean over the terrains or kinds."""

MEAN = 'mean'

FAULTY_STARTS = 9
"""Default number of pushed starts in a fault sweep or a transfer, besides the exact one."""


@dataclass(frozen=True)
class Trial:
    """One episode of a trained controller.

    Attributes:
        trained: the controller in its body.
        terrain: name of the terrain.
        engine: one of `sim_node.engine.ENGINES`.
        start: 0, or the seed of a pushed start, see `Simulation`.
        faults: faults of the robot.
        duration: duration of the episode [s].
        transient: time at the start of the episode that is not scored [s].
    """

    trained: TrainedController
    terrain: str
    engine: str = DEFAULT_ENGINE
    start: int = 0
    faults: Faults = NO_FAULTS
    duration: float = EPISODE
    transient: float = TRANSIENT

    def simulation(self) -> Simulation:
        """Return the simulation of the robot at its start."""
        return self.trained.simulation(self.terrain, self.engine, self.start, self.faults)

    @property
    def group(self) -> tuple:
        """Return what trials have in common that can run side by side in the batched engine."""
        one = self.trained
        return (
            self.engine, one.architecture, one.morphology.squares, self.terrain or one.terrain,
            one.material, one.solver, one.task, self.duration,
        )


def score(trial: Trial) -> Scored:
    """Return the score of a trial by the controller's task; -inf if the physics diverged."""
    task = check_task(trial.trained.task)
    simulation, controller = trial.simulation(), trial.trained.controller(trial.faults)
    faulty = '-faulty' if trial.faults.affect_cells else ''

    def episode(duration: float) -> Episode:
        return run_episode(simulation, controller, duration, task.records)

    arithmetic = trial.trained.architecture.arithmetic
    name = f'trial-{trial.engine}{faulty}-{len(task.records)}-{arithmetic}'
    warm_up(name, lambda: episode(2.0 / CONTROL_RATE))
    return score_of(task, episode(trial.duration), trial.transient)


def wall_lines(times: np.ndarray, task: Task) -> list[str]:
    """Return lines that say in how many episodes the robot met a wall.

    Args:
        times: (n_trials, 2) as from `run_trials`.
        task: task of the scores.
    """
    behind, ahead = np.isfinite(times).sum(axis=0).tolist()
    of = f'of {len(times)} episodes'
    lines = [f'in {behind} {of} the robot met the wall behind its start'] if behind else []
    if ahead:
        lines.append(
            f'in {ahead} {of} the robot met the wall at the end of the ground; {task.quantity} is '
            f'measured until then'
        )
    return lines


def wall_cells(times: np.ndarray) -> list[tuple[float | None, float | None]]:
    """Return the entries of a table for (n, 2) `times` of `run_trials`.

    None, for NaN, is an empty cell in a CSV file and null in JSON.
    """
    shown = [float(f'{time:.9g}') if np.isfinite(time) else None for time in times.ravel().tolist()]
    return list(zip(shown[::2], shown[1::2], strict=True))


def all_trials(
    trained: Sequence[TrainedController],
    faults: Sequence[Faults],
    terrains: Sequence[str],
    engine: str,
    n_starts: int,
    duration: float = EPISODE,
) -> list[Trial]:
    """Return the episodes of all combinations, ordered by controller, faults, start and terrain.

    The seed of the faults of start s is their own seed plus s.
    """
    return [
        Trial(one, terrain, engine, start, replace(given, seed=given.seed + start), duration)
        for one, given, start, terrain in product(trained, faults, range(n_starts), terrains)
    ]


def common_task(trained: Sequence[TrainedController]) -> Task:
    """Return the task that the controllers have in common.

    Raises:
        InvalidInput: they have different tasks.
    """
    names = list(dict.fromkeys(one.task for one in trained))
    if len(names) != 1:
        expected = 'controllers of one task: scores of different tasks cannot be compared'
        raise InvalidInput('controllers', names, expected)
    return check_task(names[0])


@dataclass(frozen=True)
class AssessmentOptions:
    """Options of an assessment.

    Raises:
        InvalidInput: a value is invalid, or the episode is not longer than the transient.
    """

    starts: int = constant(0, 0, 10_000, 'number of pushed starts besides the exact one')
    duration: float = constant(EPISODE, TRANSIENT, LONGEST, 'duration of an episode', 's')
    engine: str = choice(DEFAULT_ENGINE, ENGINES, 'physics engine')
    arithmetic: str = choice(
        DEFAULT_ARITHMETIC, ARITHMETICS, 'arithmetic of the cells, as in firmware'
    )
    terrain_seeds: int = constant(
        1, 1, MOST_TERRAIN_SEEDS, 'number of seeds of each irregular unseen terrain; the scores '
        'are means of each kind and over the kinds'
    )

    def __post_init__(self) -> None:
        check_declared(self)
        if steps_in(self.duration) <= steps_in(TRANSIENT):
            expected = f'a time above {TRANSIENT:g} s, since the first {TRANSIENT:g} s do not count'
            raise InvalidInput('duration', self.duration, expected)


def means_of_kinds(kinds: dict[str, tuple[str, ...]], scores: np.ndarray) -> np.ndarray:
    """Return the mean score of each kind of terrain, and the mean over the kinds.

    Args:
        kinds: the names of the terrains of each kind.
        scores: (n_terrains, n_starts), kind by kind.

    Returns:
        (n_kinds + 1, n_starts); the last row is the mean over the kinds.
    """
    ends = np.cumsum([len(names) for names in kinds.values()])[:-1]
    means = np.stack([of_kind.mean(axis=0) for of_kind in np.split(scores, ends)])
    return np.concatenate([means, means.mean(axis=0, keepdims=True)])


def table(
    name: str, terrains: Sequence[str], scores: np.ndarray, quantity: str
) -> list[str]:
    """Return the scores of one controller as lines of text.

    Args:
        name: name of the controller.
        terrains: names of the terrains.
        scores: (n_terrains, 1 + n_pushed); the table has mean and sample standard deviation of the
            pushed starts.
        quantity: name of the quantity that is scored.
    """
    n_pushed = scores.shape[1] - 1
    head = f'{"":24}{quantity:>9}'
    head = f'{head}{"mean":>9}{"std":>9}  of {n_pushed} pushed starts' if n_pushed else head
    lines = [name, head]
    for terrain, (exact, *pushed) in zip(terrains, scores, strict=True):
        numbers = [exact, *summary(pushed)] if pushed else [exact]
        lines.append(f'{terrain:24}' + ''.join(f'{number:9.3f}' for number in numbers))
    return lines


def summary(scores: Sequence[float]) -> tuple[float, float]:
    """Return mean and sample standard deviation; -inf and NaN if an episode diverged."""
    with np.errstate(invalid='ignore'):
        return float(np.mean(scores)), float(np.std(scores, ddof=min(1, len(scores) - 1)))


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence]) -> None:
    """Write a table to a CSV file, atomically; InvalidInput if it cannot be written."""
    text = io.StringIO()
    csv.writer(text, lineterminator='\n').writerows([columns, *rows])
    try:
        write_text(path, text.getvalue())
    except OSError as error:
        shown = f'{path}: {error.strerror}'
        raise InvalidInput('csv', shown, 'a file that can be written') from None
