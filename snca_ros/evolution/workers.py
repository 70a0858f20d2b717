"""Evaluations in parallel processes, in the order asked for, whatever their number."""

import contextlib
import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor

import numpy as np

from sim_node.batched.robots import Robots
from snca_ros.controller import Controller
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.crowd import run_episodes
from snca_ros.evolution.locomotion import Episode, run_episode


class Evaluator:
    """Scores candidates of one run, one episode each, in the engine of its configuration.

    A score depends on the candidate and the configuration alone, not on its companions.
    """

    def __init__(self, config: RunConfig) -> None:
        self.config = config
        self.simulation = config.simulation()
        self._robots: dict[int, Robots] = {}

    def __call__(self, thetas: np.ndarray, duration: float | None = None) -> list[float]:
        """Return v_x [m/s] of each of (n, n_parameters) candidates; -inf if it diverged.

        In the batched engine n is at most `WIDTHS[-1]`; their robots walk side by side.
        """
        duration = duration or self.config.duration
        episodes = (
            self._side_by_side(thetas, duration)
            if self.config.engine == 'batched'
            else self._one_by_one(thetas, duration)
        )
        return [episode.velocity(self.config.transient) for episode in episodes]

    def _one_by_one(self, thetas: np.ndarray, duration: float) -> Iterator[Episode]:
        for theta in thetas:
            controller = Controller(self.config.architecture, self.simulation.morphology, theta)
            yield run_episode(self.simulation, controller, duration)

    def _side_by_side(self, thetas: np.ndarray, duration: float) -> list[Episode]:
        simulation, width = self.simulation, group_width(len(thetas))
        if width not in self._robots:
            self._robots[width] = Robots(
                simulation.morphology, simulation.terrain, simulation.material,
                simulation.solver, width,
            )
        return run_episodes(
            self._robots[width], self.config.architecture, simulation.morphology, thetas, duration
        )


WIDTHS = (4, 8, 16)
"""Numbers of lanes for which the batched engine is compiled here, when it is needed."""


def group_width(n: int) -> int:
    """Return the least of `WIDTHS` that holds `n` robots, or the largest."""
    return next((width for width in WIDTHS if width >= n), WIDTHS[-1])


_evaluator: Evaluator


def _start_worker(config: RunConfig) -> None:
    global _evaluator
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    _evaluator = Evaluator(config)


def _end_with_parent() -> None:
    """End this worker when its parent is gone, however it ended."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)


def _evaluate(thetas: np.ndarray) -> list[float]:
    return _evaluator(thetas)


class WorkerPool:
    """A pool of worker processes, each with a simulation of its own; a context manager."""

    def __init__(self, config: RunConfig, n_workers: int) -> None:
        self._engine, self._n_workers = config.engine, n_workers
        # Compile, or load from the cache, once here rather than in every worker at once.
        evaluator = Evaluator(config)
        for n in {self._group_size(config.population), 1}:
            evaluator(np.zeros((n, config.n_parameters)), 2.0 / 60.0)
        self._executor = ProcessPoolExecutor(
            n_workers, multiprocessing.get_context('spawn'), _start_worker, (config,)
        )

    def __enter__(self) -> 'WorkerPool':
        return self

    def __exit__(self, *exc_info: object) -> None:
        self._executor.shutdown(wait=True, cancel_futures=True)

    @property
    def processes(self) -> list[int]:
        """Return the process ids of the workers that have been started."""
        return sorted(self._executor._processes or ())

    def evaluate(self, candidates: np.ndarray) -> Iterator[float]:
        """Yield the fitness of each candidate, in their order."""
        size = self._group_size(len(candidates))
        with _interrupts_held():  # a worker that is starting must not see Ctrl-C
            futures = [
                self._executor.submit(_evaluate, candidates[i : i + size])
                for i in range(0, len(candidates), size)
            ]
        for future in futures:
            yield from future.result()

    def _group_size(self, n: int) -> int:
        """Return how many of `n` candidates go to a worker at a time."""
        return 1 if self._engine == 'pymunk' else group_width(-(-n // self._n_workers))


@contextlib.contextmanager
def _interrupts_held() -> Iterator[None]:
    old = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, old)
