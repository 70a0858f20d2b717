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

from snca_ros.controller import Controller
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.locomotion import run_episode


class Evaluator:
    """Scores candidates of one run, one episode each.

    The score depends on the candidate and the run's configuration alone.
    """

    def __init__(self, config: RunConfig) -> None:
        self.config = config
        self.simulation = config.simulation()

    def __call__(self, theta: np.ndarray, duration: float | None = None) -> float:
        """Return v_x [m/s] of one episode, or -inf if its physics diverged."""
        config = self.config
        controller = Controller(config.architecture, self.simulation.morphology, theta)
        episode = run_episode(self.simulation, controller, duration or config.duration)
        return episode.velocity(config.transient)


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


def _evaluate(theta: np.ndarray) -> float:
    return _evaluator(theta)


class WorkerPool:
    """A pool of worker processes, each with a simulation of its own; a context manager."""

    def __init__(self, config: RunConfig, n_workers: int) -> None:
        # Compile, or load from the cache, once here rather than in every worker at once.
        Evaluator(config)(np.zeros(config.n_parameters), 2.0 / 60.0)
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
        with _interrupts_held():  # a worker that is starting must not see Ctrl-C
            futures = [self._executor.submit(_evaluate, theta) for theta in candidates]
        for future in futures:
            yield future.result()


@contextlib.contextmanager
def _interrupts_held() -> Iterator[None]:
    old = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, old)
