"""Trials on workers, side by side in the lanes of the batched engine."""

from collections.abc import Sequence

import numpy as np

from sim_node.batched.engine import BatchedEngine, Robots
from sim_node.control_time import CONTROL_RATE
from sim_node.engine import ENGINES
from sim_node.model.terrain import parse_terrain
from sim_node.numerics.jit import warm_up
from snca_ros.assessment.trials import Trial, score
from snca_ros.evolution.episode import Episode
from snca_ros.evolution.episode_lanes import run_episodes
from snca_ros.evolution.evaluator import group_width
from snca_ros.evolution.tasks import Scored, check_task, score_of
from snca_ros.evolution.workers import Workers


def run_trials(workers: Workers, trials: Sequence[Trial]) -> tuple[np.ndarray, np.ndarray]:
    """Run trials; the result does not depend on the workers.

    In the batched engine, trials that differ in parameters, starts and faults alone run side by
    side.

    Returns:
        The score of each trial, (n_trials,), and the times [s] at which the robot met the walls
        behind its start and at the end of the ground, (n_trials, 2); NaN if it did not.
    """
    groups = groups_of(trials, workers.count())
    futures = [
        workers.executor.submit(score_side_by_side, [trials[i] for i in group]) for group in groups
    ]
    scores, times = np.empty(len(trials)), np.empty((len(trials), 2))
    for group, future in zip(groups, futures, strict=True):
        for i, found in zip(group, future.result(), strict=True):
            scores[i], times[i] = found.score, found.walls.times
    return scores, times


def groups_of(trials: Sequence[Trial], n_workers: int) -> list[list[int]]:
    """Return the indices of trials that run side by side, in groups for `n_workers` workers.

    In the batched engine, a group has as many trials as there are lanes, else one.
    """
    alike: dict[tuple, list[int]] = {}
    for i, trial in enumerate(trials):
        alike.setdefault(trial.group, []).append(i)
    groups = []
    for indices in alike.values():
        engine = ENGINES.find(trials[indices[0]].engine)
        lanes = engine.lanes if engine is BatchedEngine else (1,)
        size = group_width(lanes, -(-len(trials) // n_workers))
        groups += [indices[i : i + size] for i in range(0, len(indices), size)]
    return groups


def score_side_by_side(trials: Sequence[Trial]) -> list[Scored]:
    """Return the score of each of a group of trials, to the bit as `score` does.

    Args:
        trials: trials of the same `Trial.group` of the batched engine, as many as it has lanes; or
            one trial.
    """
    one, trained = trials[0], trials[0].trained
    if len(trials) == 1:
        return [score(one)]
    task = check_task(trained.task)
    architecture, morphology = trained.architecture, trained.morphology
    robots = Robots(
        morphology, parse_terrain(one.terrain or trained.terrain), trained.material, trained.solver,
        group_width(BatchedEngine.lanes, len(trials)), sensors=architecture.sensors,
    )
    parameters = np.stack([trial.trained.parameters for trial in trials])
    starts, faults = [trial.start for trial in trials], [trial.faults for trial in trials]

    def episodes(duration: float) -> list[Episode]:
        return run_episodes(
            robots, architecture, morphology, parameters, duration, starts, faults, task.records
        )

    faulty = '-faulty' if any(own.any for own in faults) else ''
    cell = f'{architecture.neuron_model}-{architecture.arithmetic}'
    name = f'trials-{one.engine}-{robots.sane.size}{faulty}-{len(task.records)}-{cell}'
    warm_up(name, lambda: episodes(2.0 / CONTROL_RATE))
    return [
        score_of(task, episode, trial.transient)
        for trial, episode in zip(trials, episodes(one.duration), strict=True)
    ]
