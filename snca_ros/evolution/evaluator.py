"""Evaluation of candidates by workers; the scores do not depend on which worker computes them."""

import functools
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future
from typing import NamedTuple, Protocol

import numpy as np

from sim_node.batched.engine import BatchedEngine
from sim_node.control_time import CONTROL_RATE
from sim_node.engine import ENGINES, Engine
from sim_node.numerics.jit import warm_up
from snca_ros.controller import Controller
from snca_ros.evolution.conditions import Conditions
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import Episode, run_episode
from snca_ros.evolution.episode_lanes import SideBySide
from snca_ros.evolution.tasks import Scored, check_task, score_of
from snca_ros.evolution.workers import Workers


class GroupRunner(Protocol):
    """Runs episodes of several candidates of a run."""

    def __call__(
        self, candidates: np.ndarray, width: int, duration: float, conditions: Conditions
    ) -> Iterable[Episode]:
        """Return an episode of each of (n, n_parameters) candidates, n <= `width`.

        Args:
            candidates: their parameters.
            width: number of robots side by side, one of the engine's `lanes`.
            duration: of the episodes [s].
            conditions: of the episodes.
        """


class OneByOne:
    """Runs the episodes one after another, in any engine.

    Args:
        config: configuration of the run.
    """

    def __init__(self, config: RunConfig) -> None:
        self._config, self._records = config, check_task(config.task).records
        self._simulation = functools.lru_cache(maxsize=1)(config.simulation)

    def __call__(
        self, candidates: np.ndarray, width: int, duration: float, conditions: Conditions
    ) -> Iterator[Episode]:
        """Yield an episode of each of (n, n_parameters) candidates, n of any size."""
        simulation = self._simulation(conditions)
        for candidate in candidates:
            controller = Controller(
                self._config.architecture, simulation.morphology, candidate, conditions.faults
            )
            yield run_episode(simulation, controller, duration, self._records)


GROUP_RUNNERS: dict[type[Engine], Callable[[RunConfig], GroupRunner]] = {
    BatchedEngine: SideBySide,
}
"""Runners for engines that step robots side by side; other engines use `OneByOne`."""


class Evaluator:
    """Scores candidates of a run by its task, with one episode each in the engine of the run.

    A score depends only on the candidate, the configuration and the conditions, not on the other
    candidates.

    Args:
        config: configuration of the run.
    """

    def __init__(self, config: RunConfig) -> None:
        self.config, self._task = config, check_task(config.task)
        engine = ENGINES.find(config.engine)
        self._lanes, self._run = engine.lanes, GROUP_RUNNERS.get(engine, OneByOne)(config)
        self._ready: set[str] = set()

    def __call__(
        self, candidates: np.ndarray, conditions: Conditions | None = None
    ) -> list[Scored]:
        """Return the score of each of (n, n_parameters) candidates; -inf if it diverged.

        Args:
            candidates: their parameters. If the engine steps robots side by side, n is at most
                the last of its `lanes`.
            conditions: of their episodes, the same for all; None for `RunConfig.conditions`.
        """
        config, width = self.config, group_width(self._lanes, len(candidates))
        conditions = conditions or config.conditions()
        name = f'episode-{config.engine}-{width}-{len(self._task.records)}{_kind(conditions)}'
        if name not in self._ready:  # only one of a machine's workers compiles
            brief = 2.0 / CONTROL_RATE
            warm_up(name, lambda: list(self._run(candidates, width, brief, conditions)))
            self._ready.add(name)
        episodes = self._run(candidates, width, config.duration, conditions)
        return [score_of(self._task, episode, config.transient) for episode in episodes]


def _kind(conditions: Conditions) -> str:
    """Return a name of the code that episodes compile besides that of episodes without faults."""
    faults = conditions.faults
    return '-faulty' * faults.affect_cells + '-body' * faults.affect_body


def group_width(lanes: Sequence[int], n: int) -> int:
    """Return the smallest of an engine's `lanes` that holds `n` robots, else the largest."""
    return next((width for width in lanes if width >= n), lanes[-1])


def evaluate(
    workers: Workers, config: RunConfig, candidates: np.ndarray,
    conditions: Conditions | None = None,
) -> Iterator[Scored]:
    """Yield the score of each of (n, n_parameters) candidates, in their order.

    The scores do not depend on the workers or their number.

    Args:
        workers: workers that evaluate.
        config: configuration of the run.
        candidates: their parameters.
        conditions: of their episodes; None for `RunConfig.conditions`.
    """
    for future in _submit(workers, config, candidates, [conditions or config.conditions()])[0]:
        yield from future.result()


class SetScore(NamedTuple):
    """The score of a candidate on a set of episodes.

    Attributes:
        score: the scores of its episodes, combined.
        wall_time: the earliest time [s] at which it met the wall at the end of the ground in an
            episode; None if it met it in none.
    """

    score: float
    wall_time: float | None


def evaluate_set(
    workers: Workers, config: RunConfig, candidates: np.ndarray, conditions: Sequence[Conditions]
) -> list[SetScore]:
    """Return the score of each of (n, n_parameters) candidates on a set of episodes.

    The scores do not depend on the workers or their number.

    Args:
        workers: workers that evaluate.
        config: configuration of the run.
        candidates: their parameters.
        conditions: of the episodes of each candidate.
    """
    submitted = _submit(workers, config, candidates, conditions)
    by_episode = [[one for future in row for one in future.result()] for row in submitted]
    found = []
    for of_one in zip(*by_episode, strict=True):
        times = [one.walls.times[1] for one in of_one if one.walls.times[1] is not None]
        score = config.episode_set.combined([one.score for one in of_one])
        found.append(SetScore(score, min(times, default=None)))
    return found


def _submit(
    workers: Workers, config: RunConfig, candidates: np.ndarray, conditions: Sequence[Conditions]
) -> list[list[Future[list[Scored]]]]:
    """Submit the episodes of all candidates, in groups that have the same conditions.

    Returns:
        For each of the conditions, the future scores of the groups of candidates.
    """
    lanes = ENGINES.find(config.engine).lanes
    size = group_width(lanes, -(-len(candidates) * len(conditions) // workers.count()))
    groups = [candidates[i : i + size] for i in range(0, len(candidates), size)]
    return [
        [workers.executor.submit(score, config, group, one) for group in groups]
        for one in conditions
    ]


def score(config: RunConfig, candidates: np.ndarray, conditions: Conditions) -> list[Scored]:
    """Return the score of each of a group of candidates; see `Evaluator`."""
    return _evaluator(config, threading.get_ident())(candidates, conditions)


@functools.lru_cache(maxsize=2)
def _evaluator(config: RunConfig, thread: int) -> Evaluator:
    """Return the evaluator of this thread, since a simulation runs one episode at a time."""
    return Evaluator(config)
