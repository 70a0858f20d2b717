"""Transfer: scores of controllers in many bodies, a matrix of minds and bodies."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.morphology import Morphology
from snca_ros.assessment.trials import WALLS, Trial, all_trials, summary
from snca_ros.evolution.episode import EPISODE
from snca_ros.faults import NO_FAULTS
from snca_ros.trained_controller import TrainedController

COLUMNS = ('controller', 'body', 'home', 'terrain', 'engine', 'start', *WALLS)
"""Columns of the CSV file, one row per episode; the last column is the score, named after the
task's quantity. `home` is True if the controller was evolved in that body."""


@dataclass(frozen=True, eq=False)
class Transfer:
    """Controllers in bodies.

    Attributes:
        names: names of the controllers.
        bodies: the bodies.
        robots: each controller in each body; None where it does not fit, since its cells are
            non-uniform.
        home: (n_controllers, n_bodies) bool, whether the controller was evolved in that body.
    """

    names: tuple[str, ...]
    bodies: tuple[Morphology, ...]
    robots: tuple[tuple[TrainedController | None, ...], ...]
    home: np.ndarray

    @property
    def labels(self) -> tuple[str, ...]:
        """Return the names of the bodies, with the voxels that they lack."""
        return tuple(body.label for body in self.bodies)

    @property
    def fits(self) -> np.ndarray:
        """Return the (n_controllers, n_bodies) bool array of `robots` that are not None."""
        return np.array([[robot is not None for robot in row] for row in self.robots])

    def pairs(self) -> list[tuple[int, int, TrainedController]]:
        """Return index of the controller, index of the body and robot of each pair that fits."""
        return [
            (i, j, robot) for i, row in enumerate(self.robots) for j, robot in enumerate(row)
            if robot is not None
        ]

    def named_robots(self) -> tuple[list[str], list[TrainedController]]:
        """Return a name, such as 'mine in biped', and the robot of each pair that fits."""
        pairs = self.pairs()
        names = [f'{self.names[i]} in {self.labels[j]}' for i, j, _ in pairs]
        return names, [robot for _, _, robot in pairs]


def in_bodies(
    names: Sequence[str], trained: Sequence[TrainedController], bodies: Sequence[Morphology]
) -> Transfer:
    """Put controllers into bodies.

    Args:
        names: names of the controllers.
        trained: the controllers.
        bodies: the bodies; one that is named twice counts once.

    Raises:
        InvalidInput: a controller fits none of the bodies.
    """
    different = {body.grid_string: body for body in reversed(bodies)}
    chosen = tuple(reversed(different.values()))
    robots, home = [], []
    for one in trained:
        robots.append(tuple(_in_body(one, body) for body in chosen))
        if not any(robots[-1]):
            one.in_body(chosen[0])  # raises InvalidInput that says why
        own = one.home or one.morphology
        home.append([body.grid_string == own.grid_string for body in chosen])
    return Transfer(tuple(names), chosen, tuple(robots), np.array(home))


def _in_body(trained: TrainedController, body: Morphology) -> TrainedController | None:
    try:
        return trained.in_body(body)
    except InvalidInput:
        return None


def transfer_trials(
    transfer: Transfer,
    terrains: Sequence[str],
    engine: str,
    n_starts: int,
    duration: float = EPISODE,
) -> list[Trial]:
    """Return the episodes, ordered by controller, body, start and terrain."""
    _, robots = transfer.named_robots()
    return all_trials(robots, [NO_FAULTS], terrains, engine, n_starts, duration)


def matrix(transfer: Transfer, scores: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return mean and standard deviation over the starts of each controller in each body.

    Args:
        transfer: controllers in bodies.
        scores: (n_pairs, n_starts, n_terrains) of the pairs that fit. If there are pushed starts,
            the exact one, which is the first, does not count. A start has the mean over terrains.

    Returns:
        Means and sample standard deviations, (n_controllers, n_bodies) each; NaN where a controller
        does not fit, -inf and NaN where an episode diverged.
    """
    of_starts = scores.mean(axis=2)[:, min(1, scores.shape[1] - 1) :]
    means, deviations = np.full((2, *transfer.home.shape), np.nan)
    found = np.array([summary(of_pair.tolist()) for of_pair in of_starts])
    means[transfer.fits], deviations[transfer.fits] = found.T
    return means, deviations


def table(transfer: Transfer, means: np.ndarray) -> list[str]:
    """Return the mean scores as lines of text, a row per controller and a column per body."""
    labels = transfer.labels
    first = max(map(len, ('', *transfer.names)))
    widths = [max(8, len(label)) for label in labels]
    head = ''.join(f' {label:>{width}} ' for label, width in zip(labels, widths, strict=True))
    lines = [f'{"":{first}}{head}'.rstrip()]
    for name, of_one, at_home in zip(transfer.names, means, transfer.home, strict=True):
        cells = [
            ('-' if np.isnan(mean) else f'{mean:.3f}') + ('*' if home else ' ')
            for mean, home in zip(of_one, at_home, strict=True)
        ]
        shown = (f' {cell:>{width + 1}}' for cell, width in zip(cells, widths, strict=True))
        lines.append(f'{name:{first}}{"".join(shown)}'.rstrip())
    if transfer.home.any():
        lines.append('* the body that the controller was evolved in')
    if not transfer.fits.all():
        lines.append('- a non-uniform controller, which has no cells for this body')
    return lines
