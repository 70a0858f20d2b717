"""What a task is: what it records of an episode, and the score that it gives the episode."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from sim_node.control_time import CONTROL_RATE, steps_in
from sim_node.errors import InvalidInput
from sim_node.model.terrain import DEFAULT_TERRAIN
from sim_node.walls import NO_WALLS, Walls

TRANSIENT = 5.0
"""What is not scored at the start of an episode [s] (paper, section 4.1)."""

RECORDS = ('actuation', 'area_ratios', 'touching', 'work')
"""Arrays of an episode that a task can ask for, (n_steps, n_voxels) each, see `Episode`."""


@dataclass(frozen=True)
class Episode:
    """What an episode of n_steps control steps of 1/60 s left behind.

    Attributes:
        centers: (n_steps + 1, 2) centre of mass x, y [m]; row 0 is the start, row k + 1 is after
            control step k.
        diverged: the physics left the finite numbers before the end; n_steps is then smaller.
        records: the arrays of `RECORDS` that were asked for, by name, (n_steps, n_voxels) each.
            Row k belongs to control step k: `actuation` in [-1, 1] as it acted during the step;
            `area_ratios` (area over area at rest) and `touching` (1.0 on the ground, else 0.0)
            after it; `work` of each voxel's actuator in it [J], see `sim_node.model.work`.
        walls: the walls that the robot met, and when.
    """

    centers: np.ndarray
    diverged: bool
    records: Mapping[str, np.ndarray] = field(default_factory=dict, kw_only=True)
    walls: Walls = field(default=NO_WALLS, kw_only=True)

    def velocity(self, transient: float = TRANSIENT) -> float:
        """Return v_x [m/s] after `transient` seconds, or -inf if the episode diverged.

        It is measured until the robot meets the wall at the end of the ground.
        """
        return -np.inf if self.diverged else mean_velocity(
            self.walls.free_part(self.centers[:, 0]), transient
        )


def first_scored(n_steps: int, transient: float) -> int:
    """Return the first control step that is scored; 0 if all belong to the transient [s]."""
    first = steps_in(transient)
    return first if first < n_steps else 0


def mean_velocity(x: np.ndarray, transient: float = TRANSIENT) -> float:
    """Return the mean velocity [m/s] of positions `x` [m], one per control step from step 0."""
    first = first_scored(len(x) - 1, transient)
    if len(x) < 2:
        return 0.0
    return float((x[-1] - x[first]) / ((len(x) - 1 - first) / CONTROL_RATE))


class Task(ABC):
    """What robots are evolved for.

    Attributes:
        quantity: what is scored, as a column name, such as 'v_x'.
        unit: of the score, such as 'm/s'; '' if it has none.
        records: names of `RECORDS` that `score` needs; centres of mass are always recorded.
        terrain: name of the terrain on which robots evolve unless another one is given.
    """

    quantity: str
    unit: str
    records: tuple[str, ...] = ()
    terrain: str = DEFAULT_TERRAIN

    @abstractmethod
    def score(self, episode: Episode, transient: float) -> float:
        """Return the score of an episode that did not diverge; larger is better.

        It must depend on nothing but the arguments, and not on what follows the meeting with the
        wall at the end of the ground (`episode.walls.free_part`).

        Args:
            episode: what was recorded.
            transient: how much of the episode's start is not to be scored [s], as the run says;
                up to the whole episode.
        """

    @property
    def label(self) -> str:
        """Return quantity and unit as the label of an axis, such as 'v_x [m/s]'."""
        return f'{self.quantity} [{self.unit}]' if self.unit else self.quantity

    def in_unit(self, score: float, digits: int = 3) -> str:
        """Return a score with its unit, such as '8.213 m/s'."""
        return f'{score:.{digits}f} {self.unit}'.rstrip()


class Scored(NamedTuple):
    """The score of an episode, and the walls that the robot met in it."""

    score: float
    walls: Walls


def score_of(task: Task, episode: Episode, transient: float) -> Scored:
    """Return the score of an episode; -inf if it diverged.

    Args:
        task: what the robot was to do.
        episode: with the task's `records`.
        transient: as of `Task.score` [s].

    Raises:
        InvalidInput: the task gave something that cannot be compared.
    """
    if episode.diverged:
        return Scored(-math.inf, episode.walls)
    score = task.score(episode, transient)
    if not isinstance(score, (int, float, np.floating, np.integer)) or math.isnan(score):
        name = f'{type(task).__name__}.score'
        raise InvalidInput(name, score, f'a number, {task.quantity} of the episode')
    return Scored(float(score), episode.walls)
