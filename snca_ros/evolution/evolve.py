"""The evolution loop, which trains the parameters that the voxel nodes load."""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from sim_node.engine import check_engine
from sim_node.errors import InvalidInput
from snca_ros.evolution.checkpoint import Progress, RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evaluator import evaluate
from snca_ros.evolution.strategies import Strategy
from snca_ros.evolution.tasks import Scored
from snca_ros.evolution.workers import Workers


def evolve(
    folder: RunFolder, workers: Workers, report: Callable[[Progress], None] = lambda progress: None
) -> Progress:
    """Start or resume the run of `folder`, until its evaluations are spent.

    best.npz holds the best individual in the run's engine. At the end it is scored by one episode
    in the other engine, too.

    Args:
        folder: folder of the run; it is updated after every generation, while the next one runs.
        workers: workers that evaluate; the result does not depend on them.
        report: called with the `Progress` after every generation.
    """
    config = folder.config
    progress = folder.load()
    if progress.evaluations < config.evaluations:
        progress = _run_generations(folder, progress, workers, report)
    if progress.score_other is None and not progress.by_old_rules:
        best = progress.strategy['individuals'][:1]
        score = _score_in_other_engine(config, best, workers)
        progress = replace(progress, score_other=score)
        folder.save(progress)
    return progress


def _score_in_other_engine(config: RunConfig, best: np.ndarray, workers: Workers) -> float:
    """Return the score of one candidate, (1, n_parameters); NaN if the engine cannot run it."""
    try:
        check_engine(config.other_engine, config.solver)
    except InvalidInput:
        return math.nan
    return next(evaluate(workers, replace(config, engine=config.other_engine), best)).score


def _run_generations(
    folder: RunFolder, progress: Progress, workers: Workers, report: Callable[[Progress], None]
) -> Progress:
    config, strategy = folder.config, folder.config.new_strategy()
    if progress.history:
        try:
            strategy.restore(progress.strategy)
        except InvalidInput as error:
            raise error.found_in(str(folder.path / 'checkpoint.npz')) from None
    with ThreadPoolExecutor(max_workers=1) as saver:  # the block ends after the last save
        saved = saver.submit(lambda: None)
        while progress.evaluations < config.evaluations:
            asked = strategy.ask()
            candidates = asked[: config.evaluations - progress.evaluations]
            is_cut = len(candidates) < len(asked)
            scored = list(evaluate(workers, config, candidates))
            fitness = np.array([one.score for one in scored])
            strategy.tell(candidates, fitness)
            progress = Progress(
                strategy.state(),
                [*progress.history, _history_row(progress, fitness, strategy)],
                whole=progress.population if is_cut and progress.history else None,
                wall_time=_wall_time(progress, scored),
            )
            saved.result()
            saved = saver.submit(folder.save, progress)
            report(progress)
        saved.result()
    return progress


def _wall_time(before: Progress, scored: Sequence[Scored]) -> float | None:
    """Return when the best individual so far met the wall at the end of the ground [s]."""
    best = max(scored, key=lambda one: one.score)
    is_better = not before.history or best.score > before.history[-1][-1]
    return best.walls.times[1] if is_better else before.wall_time


def _history_row(
    before: Progress, fitness: np.ndarray, strategy: Strategy
) -> tuple[float, ...]:
    return (
        len(before.history),
        before.evaluations + len(fitness),
        float(fitness.max()),
        float(np.median(fitness)),
        float(fitness.min()),
        float(strategy.fitness[0]),
    )
