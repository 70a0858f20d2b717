"""The evolution loop, which trains the parameters that the voxel nodes load."""

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np

from sim_node.engine import check_engine
from sim_node.errors import InvalidInput
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evaluator import SetScore, evaluate_set
from snca_ros.evolution.run_progress import Progress
from snca_ros.evolution.strategies import Strategy
from snca_ros.evolution.strategies.strategy import keep_best
from snca_ros.evolution.workers import Workers


def evolve(
    folder: RunFolder, workers: Workers, report: Callable[[Progress], None] = lambda progress: None
) -> Progress:
    """Start or resume the run of `folder`, until its episodes are spent.

    best.npz holds the best individual in the run's engine. If sets of episodes are drawn, the
    parents of the last population are scored on `N_FURTHER` further episodes, and it is the best of
    them. At the end it is scored in the other engine, too, on the same episodes.

    Args:
        folder: folder of the run; it is updated after every generation, while the next one runs.
        workers: workers that evaluate; the result does not depend on them.
        report: called with the `Progress` after every generation.
    """
    progress = folder.load()
    if progress.score_other is None and not progress.by_old_rules:
        if folder.config.room(progress.episodes):
            progress = _run_generations(folder, progress, workers, report)
        progress = _finish(folder.config, progress, workers)
        folder.save(progress)
    return progress


def _finish(config: RunConfig, progress: Progress, workers: Workers) -> Progress:
    """Return the progress with the choice of the best, and its score in the other engine."""
    conditions = progress.conditions(config)
    if config.draw:
        conditions = config.episode_set.further_conditions(config.seed)
        parents = progress.strategy['individuals'][: config.n_elite]
        scored = evaluate_set(workers, config, parents, conditions)
        further = np.array([one.score for one in scored])
        wall_time = scored[int(np.argmax(further))].wall_time
        progress = replace(progress, further=further, wall_time=wall_time)
    try:
        check_engine(config.other_engine, config.solver)
    except InvalidInput:
        return replace(progress, score_other=math.nan)
    other = replace(config, engine=config.other_engine)
    found, = evaluate_set(workers, other, progress.best[np.newaxis], conditions)
    return replace(progress, score_other=found.score)


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
        while room := config.room(progress.episodes):
            conditions = config.episode_set.conditions(config.seed, len(progress.history))
            asked, kept = strategy.ask(), strategy.individuals[: 1 if config.draw else 0]
            candidates = asked[: room - len(kept)]
            is_cut = len(candidates) < len(asked) and not config.draw
            scored = evaluate_set(workers, config, np.concatenate([kept, candidates]), conditions)
            if len(kept):  # its fitness is from another set
                keep_best(strategy, scored[0].score)
            fitness = np.array([one.score for one in scored[len(kept):]])
            strategy.tell(candidates, fitness)
            spent = progress.episodes + len(scored) * len(conditions)
            progress = Progress(
                strategy.state(),
                [*progress.history, _history_row(progress, spent, fitness, strategy)],
                whole=progress.population if is_cut and progress.history else None,
                wall_time=_wall_time(progress, len(kept) > 0, scored),
            )
            saved.result()
            saved = saver.submit(folder.save, progress)
            report(progress)
        saved.result()
    return progress


def _wall_time(
    before: Progress, is_scored_again: bool, scored: Sequence[SetScore]
) -> float | None:
    """Return when the best individual now met the wall at the end of the ground [s]."""
    of_before = [SetScore(before.history[-1][-1], before.wall_time)] if before.history else []
    known = [] if is_scored_again else of_before
    return max([*known, *scored], key=lambda one: one.score).wall_time


def _history_row(
    before: Progress, spent: int, fitness: np.ndarray, strategy: Strategy
) -> tuple[float, ...]:
    return (
        len(before.history),
        spent,
        float(fitness.max()),
        float(np.median(fitness)),
        float(fitness.min()),
        float(strategy.fitness[0]),
    )
