"""Scores of candidates: a task for any worker, the same numbers wherever it runs."""

import functools
import threading
from collections.abc import Iterable, Iterator

import numpy as np

from sim_node.batched.engine import Robots
from sim_node.control_time import CONTROL_RATE
from sim_node.numerics.jit import warm_up
from snca_ros.controller import Controller
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import Episode, run_episode
from snca_ros.evolution.episode_lanes import run_episodes
from snca_ros.evolution.workers import Workers


class Evaluator:
    """Scores candidates of one run, one episode each, in the engine of its configuration.

    A score depends on the candidate, the configuration and the start alone, not on the companions.
    """

    def __init__(self, config: RunConfig) -> None:
        self.config = config
        self.simulation = config.simulation()
        self._robots: dict[int, Robots] = {}
        self._ready: set[int] = set()

    def __call__(self, thetas: np.ndarray, push: int = 0) -> list[float]:
        """Return v_x [m/s] of each of (n, n_parameters) candidates; -inf if it diverged.

        Args:
            thetas: the candidates. In the batched engine n is at most `WIDTHS[-1]`; their robots
                walk side by side.
            push: 0, or the number of a pushed start, the same for all; see `Simulation`.
        """
        self._compile(thetas)
        episodes = self._episodes(thetas, self.config.duration, push)
        return [episode.velocity(self.config.transient) for episode in episodes]

    def _compile(self, thetas: np.ndarray) -> None:
        """Make sure that of many workers on a machine only one compiles."""
        width = self._width(len(thetas))
        if width not in self._ready:
            name = f'episode-{self.config.engine}-{width}'
            warm_up(name, lambda: list(self._episodes(thetas, 2.0 / CONTROL_RATE)))
            self._ready.add(width)

    def _width(self, n: int) -> int:
        return 1 if self.config.engine == 'pymunk' else group_width(n)

    def _episodes(self, thetas: np.ndarray, duration: float, push: int = 0) -> Iterable[Episode]:
        if self.config.engine == 'batched':
            return self._side_by_side(thetas, duration, push)
        return self._one_by_one(thetas, duration, push)

    def _one_by_one(self, thetas: np.ndarray, duration: float, push: int) -> Iterator[Episode]:
        simulation = self.config.simulation(push) if push else self.simulation
        for theta in thetas:
            controller = Controller(self.config.architecture, simulation.morphology, theta)
            yield run_episode(simulation, controller, duration)

    def _side_by_side(self, thetas: np.ndarray, duration: float, push: int) -> list[Episode]:
        simulation, width = self.simulation, self._width(len(thetas))
        if width not in self._robots:
            self._robots[width] = Robots(
                simulation.morphology, simulation.terrain, simulation.material,
                simulation.solver, width,
            )
        return run_episodes(
            self._robots[width], self.config.architecture, simulation.morphology, thetas, duration,
            push,
        )


WIDTHS = (4, 8, 16)
"""Numbers of lanes for which the batched engine is compiled here, when it is needed."""


def group_width(n: int) -> int:
    """Return the least of `WIDTHS` that holds `n` robots, or the largest."""
    return next((width for width in WIDTHS if width >= n), WIDTHS[-1])


def evaluate(
    workers: Workers, config: RunConfig, candidates: np.ndarray, push: int = 0
) -> Iterator[float]:
    """Yield the fitness of each of (n, n_parameters) candidates, in their order.

    It does not depend on the workers or their number. With a `push` it is that of another start.
    """
    size = 1 if config.engine == 'pymunk' else group_width(-(-len(candidates) // workers.count()))
    groups = [candidates[i : i + size] for i in range(0, len(candidates), size)]
    futures = [workers.executor.submit(score, config, group, push) for group in groups]
    for future in futures:
        yield from future.result()


def score(config: RunConfig, thetas: np.ndarray, push: int = 0) -> list[float]:
    """Return the fitness of each of up to `WIDTHS[-1]` candidates; see `Evaluator`."""
    return _evaluator(config, threading.get_ident())(thetas, push)


@functools.lru_cache(maxsize=2)
def _evaluator(config: RunConfig, thread: int) -> Evaluator:
    """Return this thread's own evaluator: a simulation steps one episode at a time."""
    return Evaluator(config)
