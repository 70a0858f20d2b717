"""Evolution from Python, like the command `snca evolve`."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim_node.errors import InvalidInput
from snca_ros.api.processes import worker_processes
from snca_ros.api.robot import Robot
from snca_ros.evolution import evolve as offline
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.checkpoint_arrays import HISTORY
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.fault_ranges import text_of
from snca_ros.evolution.run_progress import Progress
from snca_ros.faults import Faults
from snca_ros.files import RUNS

_COUNTS = 'generation', 'episodes'


@dataclass(frozen=True, eq=False, repr=False)
class EvolutionRun:
    """A run of `evolve`, finished or not.

    Attributes:
        path: folder of the run.
        config: configuration of the run.
        best: the best robot so far.
        history: (n_generations,) structured array with the fields `generation`, `episodes`
            (spent so far), `best`, `median`, `worst` (of the generation) and `best_so_far`. Scores
            are in the unit of the run's task, such as v_x [m/s].
    """

    path: Path
    config: RunConfig
    best: Robot
    history: np.ndarray

    def __repr__(self) -> str:
        spent = self.history[-1]['episodes']
        return (
            f"EvolutionRun('{self.path}', {spent} of {self.config.episodes} episodes, "
            f'best {self.best.trained.achieved})'
        )


def evolve(
    shape: str | Sequence[str] | None = None,
    architecture: str | None = None,
    neuron_model: str | None = None,
    *,
    run: str | Path | None = None,
    resume: bool = False,
    workers: int = 1,
    report: Callable[[EvolutionRun], object] | None = None,
    terrain: str | Sequence[str] | None = None,
    faults: str | Faults | Sequence[str | Faults] | None = None,
    starts: int | None = None,
    draw: int | None = None,
    score: str | None = None,
    episodes: int | None = None,
    evaluations: int | None = None,
    seed: int | None = None,
    engine: str | None = None,
    strategy: str | None = None,
    task: str | None = None,
    population: int | None = None,
    sigma: float | None = None,
    duration: float | None = None,
    transient: float | None = None,
    physics: str | None = None,
    n_c: int | None = None,
    hidden: tuple[int, ...] | None = None,
    as_printed: bool | None = None,
    sensors: tuple[str, ...] | None = None,
) -> EvolutionRun:
    """Evolve a robot, like `snca evolve`; None stands for the default of that command.

    The result does not depend on the workers, nor on whether the run was stopped and resumed.

    Args:
        shape: name such as 'tripod', or a grid such as '1111-1001'; several, in a list or separated
            by commas, for one controller of all.
        architecture, neuron_model: names of architecture and neuron model, such as 'U-nD' and
            'snn-h'.
        run: folder of the run; None for runs/<settings>.
        resume: whether to continue the run in that folder, if there is one. Settings may be
            omitted; those that are given must be those of the run.
        workers: number of processes that evaluate; with 1 it is this process. A script with more
            must call `evolve` below `if __name__ == '__main__':`.
        report: called with the run after every generation.
        terrain: name of the terrain, or several.
        faults: faults in the episodes, see `snca_ros.evolution.episode_set.EpisodeSet`, or several.
        starts, draw, score: which episodes a candidate goes through, and what its scores are
            combined to, see there.
        engine, physics: names of engine and physics.
        episodes: total number of episodes.
        evaluations: former name of `episodes`.
        seed: seed of all random numbers.
        strategy, population, sigma: name of the strategy, and its parameters.
        task: name of the task, which defines the score of an episode, one of
            `snca_ros.evolution.tasks.TASKS`. Worker processes know the tasks of this project and of
            the modules in SNCA_PLUGINS.
        duration: duration of an episode [s].
        transient: time at the start of an episode that is not scored [s].
        n_c, hidden, as_printed, sensors: options of the cells, see
            `snca_ros.cell.architecture.Architecture`.

    Raises:
        InvalidInput: a value is invalid, or the folder is in use, is not empty, or holds another
            run.
        BrokenExecutor: a worker process ended unexpectedly; the run is intact up to the last
            generation.
    """
    if evaluations is not None:
        warnings.warn('evaluations is now episodes', DeprecationWarning, stacklevel=2)
        if episodes is not None:
            raise InvalidInput('evaluations', evaluations, 'episodes alone, its present name')
        episodes = evaluations
    if faults is not None:
        several = (faults,) if isinstance(faults, (str, Faults)) else tuple(faults)
        faults = ';'.join(map(text_of, several))
    given = {
        'shape': shape, 'architecture': architecture, 'neuron_model': neuron_model,
        'terrain': terrain, 'faults': faults, 'starts': starts, 'draw': draw, 'score': score,
        'episodes': episodes, 'seed': seed, 'engine': engine,
        'strategy': strategy, 'task': task, 'population': population, 'sigma': sigma,
        'duration': duration, 'transient': transient, 'physics': physics, 'n_c': n_c,
        'hidden': hidden, 'as_printed': as_printed, 'sensors': sensors,
    }
    given = {name: value for name, value in given.items() if value is not None}

    def report_progress(progress: Progress) -> None:
        if report is not None:
            report(_run_at(folder, progress))

    with worker_processes(workers) as opened:
        folder = _open(run, resume, given)
        try:
            progress = offline.evolve(folder, opened, report_progress)
        finally:
            folder.close()
    return _run_at(folder, progress)


def _open(run: str | Path | None, resume: bool, given: dict) -> RunFolder:
    """Return the open run folder for the arguments of `evolve`."""
    config = RunConfig.named(**given)
    config.new_strategy()  # raises InvalidInput if it is not installed, before mkdir
    path = RUNS / config.name if run is None else Path(run)
    if not (path / 'config.yaml').exists():
        return RunFolder.create(path, config)
    if not resume:
        expected = 'a new or empty folder, or resume=True to continue the run in it'
        raise InvalidInput('run', str(path), expected)
    folder = RunFolder.resume(path)
    if given and folder.config != config:
        folder.close()
        expected = f'{config.name}, the run of the other arguments'
        raise InvalidInput('run', folder.config.name, expected, str(path))
    return folder


def _run_at(folder: RunFolder, progress: Progress) -> EvolutionRun:
    kinds = [(name, np.int64 if name in _COUNTS else np.float64) for name in HISTORY]
    history = np.array([tuple(row) for row in progress.history], dtype=kinds)
    best = Robot(folder.best(progress), folder.path.resolve().name)
    return EvolutionRun(folder.path, folder.config, best, history)
