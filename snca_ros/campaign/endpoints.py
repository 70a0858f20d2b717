"""One run of a campaign: its evolution, and the assessment of two of its controllers."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sim_node.control_time import steps_in
from sim_node.errors import InvalidInput
from sim_node.model.terrain import DEFAULT_TERRAIN_SET, TERRAIN_SETS, UNSEEN_KINDS
from sim_node.simulation import Diverged
from snca_ros.assessment.trials import Trial, score, summary
from snca_ros.campaign.columns import COLUMNS, check_comparable, settings_of
from snca_ros.controller_file import load_controller, save_controller
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evaluator import evaluate, evaluate_set
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.history import CURVE_COLUMNS
from snca_ros.evolution.run_progress import Progress
from snca_ros.evolution.workers import IN_PROCESS
from snca_ros.recording.gait import dominant_frequency, steady_part, vibration_share
from snca_ros.trained_controller import TrainedController
from snca_ros.versions import package_versions

STARTS = range(1, 21)
"""Pushed starts at which the best controller is assessed in pymunk, and by which the robust one is
chosen in the run's engine."""

ROBUST_STARTS = range(101, 121)
"""Pushed starts at which the robust controller is assessed in pymunk; others than `STARTS`, since
it was chosen by those."""


@dataclass(frozen=True)
class Outcome:
    """The results of a run.

    Attributes:
        row: its row of results.csv, column to text.
        history: CSV text of its best-so-far curve.
        controller, robust: contents of its best.npz and of its robust.npz.
        n_at_wall: number of episodes of the assessment in which the robot met the wall at the end
            of the ground; their v_x is measured until then.
    """

    row: dict[str, str]
    history: str
    controller: bytes
    robust: bytes
    n_at_wall: int


def perform(config: RunConfig, path: Path) -> Outcome:
    """Start or resume a run, then assess two of its controllers; everything in this process.

    The result does not depend on whether the run was stopped and resumed.

    Args:
        config: configuration of the run.
        path: its run folder.

    Raises:
        InvalidInput: the folder cannot be used, an earlier version has finished the run in it, or
            the task is not walking.
    """
    check_comparable(config)
    versions = package_versions()  # read now, so that they are those of the loaded code
    folder = RunFolder.create_or_resume(path, config)
    try:
        progress = evolve(folder, IN_PROCESS)
        if progress.by_old_rules:
            expected = (
                'a run that has its last whole population; remove the folder to repeat the run'
            )
            raise InvalidInput('run', 'a run finished by an earlier version', expected, str(path))
        best, chosen = load_controller(path / 'best.npz'), choose_robust(config, progress)
        parameters, fitness = (of_all[chosen.place] for of_all in progress.population)
        conditions = progress.conditions(config)
        again, = evaluate_set(IN_PROCESS, config, parameters[np.newaxis], conditions)
        robust = replace(
            best, parameters=parameters, fitness=float(fitness),
            scores={config.engine: float(fitness)}, versions=versions, wall_time=again.wall_time,
            n_episodes=len(conditions),
        )
        save_controller(path / 'robust.npz', robust)
        of_best, at_wall = _of_the_best(config, best)
        of_robust, robust_at_wall = _of_the_robust(config, robust, chosen)
        found = {
            **settings_of(config),
            **{f'{name}_version': versions[name] for name in ('code', 'numpy', 'numba', 'pymunk')},
            **of_best, **of_robust,
        }
        row = {column: str(found[column]) for column in COLUMNS}
        files = (path / 'best.npz').read_bytes(), (path / 'robust.npz').read_bytes()
        return Outcome(row, _curve(progress), *files, at_wall + robust_at_wall)
    finally:
        folder.close()


@dataclass(frozen=True)
class Chosen:
    """The robust controller of a run: its index in the population, and its mean v_x [m/s]."""

    place: int
    mean: float


def choose_robust(config: RunConfig, progress: Progress) -> Chosen:
    """Return the robust controller: the individual with the largest mean v_x over `STARTS`.

    The individuals are those of the last whole population, and the episodes run in the run's
    engine, of runs on several bodies or terrains at home, see `RunConfig.conditions`. Of
    individuals with equal means, the one with the larger fitness is chosen.
    """
    individuals, _ = progress.population
    v_x = [
        [one.score for one in evaluate(IN_PROCESS, config, individuals, config.conditions(start))]
        for start in STARTS
    ]
    means = np.mean(v_x, axis=0)
    place = int(np.argmax(means))
    return Chosen(place, float(means[place]))


def _trial(config: RunConfig, trained: TrainedController) -> Trial:
    home = config.conditions().terrain
    return Trial(trained, home, duration=config.duration, transient=config.transient)


def _of_the_best(config: RunConfig, best: TrainedController) -> tuple[dict[str, object], int]:
    """Return the columns of the best controller, and the number of its episodes at the wall."""
    own = _trial(config, best)
    (unseen, at_wall), (pushed, pushed_at_wall) = _unseen(own), _pushed(own, STARTS)
    mean, deviation = summary(pushed)
    steady = steady_part(_actuation(own), config.transient)
    return {
        'terrain_set': DEFAULT_TERRAIN_SET,
        'chosen_by': best.chosen_by,
        'v_x_end': best.scores[config.engine],
        'v_x_other': best.scores.get(config.other_engine, ''),
        'starts': _format_starts(STARTS), 'v_x_pushed_mean': mean, 'v_x_pushed_std': deviation,
        'v_x_unseen': summary(unseen)[0], **dict(zip(UNSEEN_KINDS, unseen, strict=True)),
        'frequency': dominant_frequency(steady), 'vibration': vibration_share(steady),
    }, at_wall + pushed_at_wall


def _of_the_robust(
    config: RunConfig, robust: TrainedController, chosen: Chosen
) -> tuple[dict[str, object], int]:
    """Return the columns of the robust controller, and the number of its episodes at the wall."""
    own = _trial(config, robust)
    (unseen, at_wall), (pushed, pushed_at_wall) = _unseen(own), _pushed(own, ROBUST_STARTS)
    mean, deviation = summary(pushed)
    return {
        'robust_rank': 1 + chosen.place, 'v_x_robust_chosen': chosen.mean,
        'robust_starts': _format_starts(ROBUST_STARTS),
        'v_x_robust_mean': mean, 'v_x_robust_std': deviation,
        'v_x_robust_unseen': summary(unseen)[0],
    }, at_wall + pushed_at_wall


def _unseen(own: Trial) -> tuple[list[float], int]:
    """Run a trial in pymunk on each of the unseen terrains, see `_scores`."""
    return _scores([replace(own, terrain=name) for name in TERRAIN_SETS[DEFAULT_TERRAIN_SET]])


def _pushed(own: Trial, starts: Sequence[int]) -> tuple[list[float], int]:
    """Run a trial in pymunk from pushed starts, see `_scores`."""
    return _scores([replace(own, start=start) for start in starts])


def _scores(trials: Sequence[Trial]) -> tuple[list[float], int]:
    """Return v_x [m/s] of each trial, and how many met the wall at the end of the ground."""
    found = [score(trial) for trial in trials]
    return [one.score for one in found], sum(one.walls.ahead is not None for one in found)


def _format_starts(starts: range) -> str:
    return f'{starts[0]}-{starts[-1]}'


def _actuation(trial: Trial) -> np.ndarray:
    """Return the actuation in an episode, (n_steps, n_voxels).

    It ends where the physics diverges, or the robot meets the wall at the end of the ground.
    """
    simulation, controller = trial.simulation(), trial.trained.controller()
    readings, actuation = simulation.reset(), []
    try:
        for _ in range(steps_in(trial.duration)):
            actuation.append(controller.step(readings))
            readings = simulation.step(actuation[-1])
    except Diverged:
        pass
    return simulation.walls.free_part(np.array(actuation))


def _curve(progress: Progress) -> str:
    """Return the best-so-far curve as CSV: generations in which it rises, and the last one.

    If sets of episodes are drawn, each generation has another set, and it can fall.
    """
    lines = [','.join(CURVE_COLUMNS)]
    last = -np.inf
    for i, (_, episodes, *_, best_so_far) in enumerate(progress.history, 1):
        if best_so_far != last or i == len(progress.history):
            lines.append(f'{int(episodes)},{best_so_far!r}')
        last = best_so_far
    return '\n'.join([*lines, ''])
