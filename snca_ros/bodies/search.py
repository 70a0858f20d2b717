"""The search for bodies for one controller: their episodes, generation by generation."""

import math
from collections.abc import Callable, Sequence

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.morphology import Morphology
from snca_ros.assessment.running import run_trials
from snca_ros.assessment.trials import Trial
from snca_ros.bodies.archive import BodySearch, ScoredBody
from snca_ros.bodies.folder import SearchFolder
from snca_ros.bodies.settings import SearchSettings
from snca_ros.evolution.workers import Workers
from snca_ros.trained_controller import TrainedController


def check_uniform(trained: TrainedController) -> None:
    """Raise InvalidInput if a controller fits only the body that it was evolved in."""
    if not trained.architecture.uniform:
        expected = 'a uniform architecture (U-nD, U-D), whose parameters fit every body'
        raise InvalidInput('controller', trained.architecture.name, expected)


def search_bodies(
    folder: SearchFolder, workers: Workers,
    report: Callable[[BodySearch], None] = lambda search: None,
) -> BodySearch:
    """Start or continue the search of `folder`, until its episodes are spent.

    Args:
        folder: folder of the search; it is updated after every generation.
        workers: workers that run the episodes; the result does not depend on them.
        report: called with the state of the search after every generation.
    """
    search = folder.load()
    while bodies := search.ask():
        scores, times = run_trials(workers, trials_of(folder.settings, folder.trained, bodies))
        search.tell(with_scores(search.generation, bodies, scores, times))
        folder.save(search)
        report(search)
    return search


def trials_of(
    settings: SearchSettings, trained: TrainedController, bodies: Sequence[Morphology]
) -> list[Trial]:
    """Return the episodes of bodies, ordered by body and pushed start."""
    return [
        Trial(in_body, settings.terrain, settings.engine, start, duration=settings.duration)
        for in_body in map(trained.in_body, bodies)
        for start in range(1, 1 + settings.starts)
    ]


def with_scores(
    generation: int, bodies: Sequence[Morphology], scores: np.ndarray, times: np.ndarray
) -> list[ScoredBody]:
    """Return bodies with the results of their trials.

    Args:
        generation: number of the generation.
        bodies: the bodies.
        scores, times: of `trials_of` the bodies, as from `run_trials`.
    """
    n = len(bodies)
    ahead = np.fmin.reduce(times[:, 1].reshape(n, -1), axis=1).tolist()
    return [
        ScoredBody(generation, body, tuple(row), None if math.isnan(wall) else wall)
        for body, row, wall in zip(bodies, scores.reshape(n, -1).tolist(), ahead, strict=True)
    ]
