"""The state of a search for bodies: all scored ones, and the archive of elites, by pyribs."""

import math
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.morphology import Morphology
from snca_ros.bodies.grids import body_of, count_feet, mutated, random_body
from snca_ros.bodies.settings import SearchSettings

_TRIES = 200  # mutations per body of a generation, until the search gives up finding new ones


@dataclass(frozen=True)
class ScoredBody:
    """A body, and its scores by the task of the controller.

    Attributes:
        generation: number of its generation, from 0.
        body: the body.
        scores: score from each pushed start; -inf if the physics diverged.
        wall_time: earliest time [s] at which it met the wall at the end of the ground; None if it
            did not.
    """

    generation: int
    body: Morphology
    scores: tuple[float, ...]
    wall_time: float | None = None

    @cached_property
    def cell(self) -> tuple[int, int]:
        """Return its cell in the archive: number of voxels, number of feet."""
        return self.body.n_voxels, count_feet(self.body)

    @cached_property
    def score(self) -> float:
        """Return the mean score."""
        return math.fsum(self.scores) / len(self.scores)

    @property
    def name(self) -> str:
        """Return the name of the elite of its cell, such as 'size-12-feet-3'."""
        size, feet = self.cell
        return f'size-{size}-feet-{feet}'


class BodySearch:
    """MAP-Elites (Mouret and Clune, 2015) over bodies: the best one of each size and feet.

    The first generation has the body that the controller was evolved in, if it is within the
    limits, and random ones; all others have mutations of elites, each drawn with equal probability.
    No body is scored twice. Each generation has a random stream of its own, so that it depends only
    on the settings and on the bodies before it.

    Args:
        settings: settings of the search.
        home: the body that the controller was evolved in.

    Attributes:
        scored: all bodies in the order of their scores being known.

    Raises:
        InvalidInput: the extra `bodies` is not installed.
    """

    def __init__(self, settings: SearchSettings, home: Morphology) -> None:
        try:
            from ribs.archives import GridArchive
        except ImportError:
            expected = "an installation with pyribs: pip install 'snca_ros[bodies]'"
            raise InvalidInput('ribs', None, expected) from None
        self.settings, self.home = settings, body_of(home.squares)
        self.scored: list[ScoredBody] = []
        self._frame, self._seen = settings.frame, set[str]()
        most = settings.voxels, self._frame.most_feet
        self._archive = GridArchive(
            solution_dim=self._frame.width * self._frame.height, dims=most,
            ranges=[(0.5, n + 0.5) for n in most], extra_fields={'number': ((), np.int64)},
        )

    @property
    def elites(self) -> list[ScoredBody]:
        """Return the best body of each cell, ordered by size and number of feet."""
        found = [self.scored[i] for i in self._archive.data('number').tolist()]
        return sorted(found, key=lambda one: one.cell)

    @property
    def generation(self) -> int:
        """Return the number of generations that were scored."""
        return self.scored[-1].generation + 1 if self.scored else 0

    def ask(self) -> list[Morphology]:
        """Return the bodies of the next generation.

        There are fewer than `settings.batch` if the episodes end, or if no other new ones were
        found; none at the end of the search.
        """
        settings, frame = self.settings, self._frame
        wanted = min(settings.batch, settings.bodies - len(self.scored))
        rng = np.random.default_rng([settings.seed, self.generation])
        parents = [one.body for one in self.elites]
        found: dict[str, Morphology] = {}
        if not self.scored and frame.fits(self.home.squares):
            found[self.home.grid_string] = self.home
        for _ in range(_TRIES * wanted):
            if len(found) >= wanted:
                break
            body = (
                mutated(parents[int(rng.integers(len(parents)))], frame, rng) if parents
                else random_body(frame, rng)
            )
            if body.grid_string not in self._seen:
                found.setdefault(body.grid_string, body)
        return list(found.values())[:wanted]

    def tell(self, scored: Iterable[ScoredBody]) -> None:
        """Take scored bodies; one whose physics diverged cannot become an elite."""
        for one in scored:
            if math.isfinite(one.score):
                self._archive.add_single(
                    self._genome(one.body), one.score, one.cell, number=len(self.scored)
                )
            self.scored.append(one)
            self._seen.add(one.body.grid_string)

    def _genome(self, body: Morphology) -> np.ndarray:
        """Return the voxels of a body as 0 and 1, (width * height,), row by row."""
        genome = np.zeros((self._frame.height, self._frame.width))
        for x, y in body.squares:
            genome[y, x] = 1.0
        return genome.ravel()
