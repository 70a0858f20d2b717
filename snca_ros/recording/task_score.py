"""The score of a recorded walk by the task of its controller."""

from dataclasses import dataclass

import numpy as np

from sim_node.engine import ENGINES, check_engine
from sim_node.errors import InvalidInput
from sim_node.model.terrain import Terrain
from sim_node.simulation import Simulation
from snca_ros.evolution.episode import TRANSIENT, Episode, run_step_by_step
from snca_ros.evolution.tasks import check_task, score_of
from snca_ros.recording.recording import Recording
from snca_ros.trained_controller import TrainedController


@dataclass(frozen=True)
class TaskScore:
    """The score of a walk.

    Attributes:
        task, quantity, unit: the task, and what it scores.
        score: of the walk; None if it is not known.
    """

    task: str
    quantity: str
    unit: str
    score: float | None

    @property
    def line(self) -> str:
        """Return the line of a report."""
        known = self.score is not None
        value = f'{self.score:.3f} {self.unit}' if known else (
            f'[{self.unit}] is not known: the walk in the bag cannot be repeated to the bit'
        )
        return f'task       {self.task}: {self.quantity} {value}'


def score_walk(recording: Recording, trained: TrainedController) -> TaskScore:
    """Return the score of a recorded walk of the controller by its task.

    A task that has records needs more than a bag holds. Then the physics is repeated with the
    actuation that moved the body. The score is known if the centre of mass has the recorded
    positions, bit for bit, in an engine.
    """
    task = check_task(trained.task)
    episode: Episode | None = None
    if not np.isfinite(recording.centers).all():
        pass
    elif task.records:
        episode = _repeated(recording, trained, task.records)
    else:
        episode = Episode(recording.centers, diverged=False, walls=recording.walls)
    score = None if episode is None else score_of(task, episode, TRANSIENT).score
    return TaskScore(trained.task, task.quantity, task.unit, score)


class _Played:
    """Steps like a controller, but returns recorded actuation, (n_steps, n_voxels)."""

    def __init__(self, actuation: np.ndarray) -> None:
        self._actuation = actuation

    def reset(self) -> None:
        self._rows = iter(self._actuation)

    def step(self, readings: np.ndarray) -> np.ndarray:
        return next(self._rows)


def _repeated(
    recording: Recording, trained: TrainedController, records: tuple[str, ...]
) -> Episode | None:
    """Return the episode of the recorded walk with further records; None if it differs."""
    applied = recording.applied[:-1]
    if recording.poses is None or not np.isfinite(applied).all():
        return None
    x, y = recording.poses.ground.T.copy()
    for engine in ENGINES:
        try:
            check_engine(engine, trained.solver)
        except InvalidInput:
            continue
        simulation = Simulation(
            trained.morphology, Terrain('recorded', x, y), material=trained.material,
            solver=trained.solver, engine=engine, sensors=trained.architecture.sensors,
        )
        episode = run_step_by_step(simulation, _Played(applied), len(applied), records)
        if np.array_equal(episode.centers, recording.centers):
            return episode
    return None
