"""The run folder: config.yaml, checkpoint.npz, history.csv, best.npz.

checkpoint.npz has the complete state of the run and is replaced atomically after each generation;
history.csv and best.npz are derived from it. So a run that is killed at any moment resumes with the
same result as if it had not been stopped.
"""

import contextlib
import csv
import io
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from snca_ros.controller_file import load_controller, save_controller
from snca_ros.evolution.checkpoint_arrays import HISTORY, check_arrays
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode_set import N_FURTHER
from snca_ros.evolution.run_progress import Progress
from snca_ros.files import (
    LOCK,
    hold_folder,
    is_temporary,
    reason_of,
    remove_stale,
    write_atomically,
    write_text,
)
from snca_ros.trained_controller import TrainedController
from snca_ros.yaml_file import parse_yaml

FILES = 'config.yaml', 'checkpoint.npz', 'history.csv', 'best.npz', 'robust.npz'
"""Names of the files of a run folder; a campaign writes the last one."""


def _unwritable(path: Path, error: OSError) -> InvalidInput:
    reason = 'a file' if path.is_file() else error.strerror
    return InvalidInput('run', reason, 'a folder that can be written', str(path))


@contextlib.contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Turn errors of the block, which reads a checkpoint, into InvalidInput that names it."""
    try:
        yield
    except InvalidInput as error:
        raise error.found_in(str(path)) from None
    except Exception as error:
        expected = 'a checkpoint written by evolve'
        raise InvalidInput('file', reason_of(error), expected, str(path)) from None


def holds_controller(path: Path, trained: TrainedController) -> bool:
    """Return whether the controller file at `path` holds `trained`, except for `versions`."""
    try:
        found = load_controller(path)
    except InvalidInput:
        return False
    if not np.array_equal(found.parameters, trained.parameters):
        return False
    return replace(found, parameters=trained.parameters, versions=trained.versions) == trained


class RunFolder:
    """The folder of one run, locked against other processes until it is closed.

    Use `create`, `resume` or `create_or_resume` to open it.
    """

    def __init__(self, path: Path, config: RunConfig, wait: bool = False) -> None:
        self.path, self.config = path, config
        try:
            self._lock = hold_folder(path, 'run', wait)
            remove_stale(path, FILES)
        except OSError as error:
            raise _unwritable(path, error) from None

    @classmethod
    def create(cls, path: Path, config: RunConfig, wait: bool = False) -> 'RunFolder':
        """Create a run folder; InvalidInput if the folder exists and is not empty."""
        try:
            path.mkdir(parents=True, exist_ok=True)
            # A run that was killed before it wrote config.yaml leaves only these files.
            if any(p.name != LOCK and not is_temporary(p) for p in path.iterdir()):
                expected = 'a new or empty folder (use --resume to continue the run in it)'
                raise InvalidInput('run', 'files in it', expected, str(path))
            folder = cls(path, config, wait)
            write_text(path / 'config.yaml', config.to_yaml())
        except OSError as error:
            raise _unwritable(path, error) from None
        return folder

    @classmethod
    def resume(cls, path: Path, wait: bool = False) -> 'RunFolder':
        """Open the folder of an existing run; InvalidInput if there is none."""
        if not path.is_dir():
            raise InvalidInput('run', 'no folder', 'the folder of an earlier run', str(path))
        if not (path / 'config.yaml').exists():
            raise InvalidInput('config.yaml', None, 'the folder of an earlier run', str(path))
        return cls(path, RunConfig.from_yaml(path / 'config.yaml'), wait)

    @classmethod
    def create_or_resume(cls, path: Path, config: RunConfig) -> 'RunFolder':
        """Open the folder of a run, new or existing; wait until no other process uses it.

        Raises:
            InvalidInput: the existing run has another configuration.
        """
        if not (path / 'config.yaml').exists():
            return cls.create(path, config, wait=True)
        folder = cls.resume(path, wait=True)
        if folder.config != config:
            folder.close()
            expected = f'the configuration of {config.name}'
            raise InvalidInput('config.yaml', 'another run', expected, str(path))
        return folder

    def load(self) -> Progress:
        """Return the progress of the run; update history.csv and best.npz if they are outdated."""
        path = self.path / 'checkpoint.npz'
        if not path.exists():
            return Progress()
        with _naming(path):
            with np.load(path, allow_pickle=False) as data:
                arrays = {name: data[name] for name in data.files}
            began = self._config_in(arrays)
        self._check_unchanged(began)
        with _naming(path):
            old = 'other_engine' not in arrays
            check_arrays(arrays, self.config)
            progress = self._progress(arrays, old)
        self._write_derived(progress, only_if_changed=True)
        return progress

    def _config_in(self, arrays: dict[str, np.ndarray]) -> RunConfig:
        """Return the configuration in a checkpoint; those of earlier versions have none."""
        if 'config' not in arrays:
            return self.config
        return RunConfig.from_dict(parse_yaml(str(arrays.pop('config'))))

    def _check_unchanged(self, began: RunConfig) -> None:
        """Check that config.yaml is what it was when the run began."""
        for name in RunConfig.__dataclass_fields__:
            now, then = getattr(self.config, name), getattr(began, name)
            if now != then:
                expected = f'{then!r}, with which the run began'
                raise InvalidInput(name, now, expected, str(self.path / 'config.yaml'))

    def _progress(self, arrays: dict[str, np.ndarray], old: bool) -> Progress:
        """Return the progress from the checked arrays of a checkpoint."""
        rows, reassessed, other, wall, further, *whole = (arrays.pop(name) for name in (
            'history', 'reassessed', 'other_engine', 'wall_time', 'further', 'population',
            'population_fitness',
        ))
        progress = Progress(
            arrays, [tuple(row) for row in rows.tolist()],
            whole=(whole[0], whole[1]) if len(whole[0]) else None,
            score_other=float(other[0]) if len(other) else None,
            wall_time=float(wall[0]) if len(wall) else None,
            further=further, reassessed=reassessed,
        )
        return replace(progress, by_old_rules=old and self._spent(progress))

    def _spent(self, progress: Progress) -> bool:
        return self.config.room(progress.episodes) == 0

    def save(self, progress: Progress) -> None:
        """Write checkpoint.npz, then history.csv and best.npz."""
        whole = progress.whole or (np.empty((0, self.config.n_parameters)), np.empty(0))
        other = progress.score_other
        arrays = {
            **progress.strategy,
            'history': np.array(progress.history),
            'population': whole[0], 'population_fitness': whole[1],
            'other_engine': np.array([] if other is None else [other]),
            'config': np.array(self.config.to_yaml()),
        }
        if progress.wall_time is not None:
            arrays['wall_time'] = np.array([progress.wall_time])
        if len(progress.further):
            arrays['further'] = progress.further
        write_atomically(
            self.path / 'checkpoint.npz',
            lambda file: np.savez(file, **arrays),  # type: ignore[arg-type]
        )
        self._write_derived(progress)

    def _write_derived(self, progress: Progress, only_if_changed: bool = False) -> None:
        """Write history.csv and best.npz.

        Args:
            progress: progress of the run.
            only_if_changed: whether to keep a best.npz that holds the same controller, so that the
                file of a finished run, with the versions in it, stays as it is.
        """
        text = io.StringIO()
        writer = csv.writer(text, lineterminator='\n')
        writer.writerow(HISTORY)
        for generation, episodes, *scores in progress.history:
            writer.writerow([int(generation), int(episodes), *map(repr, scores)])
        write_text(self.path / 'history.csv', text.getvalue())
        trained = self.best(progress)
        if not (only_if_changed and holds_controller(self.path / 'best.npz', trained)):
            save_controller(self.path / 'best.npz', trained)

    def best(self, progress: Progress) -> TrainedController:
        """Return the trained controller that best.npz holds at `progress`."""
        config, episodes = self.config, self.config.episode_set
        best, chosen_by, scores = progress.chosen(config)
        return TrainedController(
            architecture=config.architecture,
            morphology=parse_morphology(episodes.shapes[0]),
            parameters=progress.strategy['individuals'][best],
            terrain=episodes.terrains[0],
            material=config.material,
            solver=config.solver,
            fitness=scores[chosen_by],
            seed=config.seed,
            evaluations=progress.episodes,
            chosen_by=chosen_by,
            task=config.task,
            scores=scores,
            wall_time=progress.wall_time,
            episode_set=None if episodes.is_plain else episodes,
            n_episodes=N_FURTHER if len(progress.further) else episodes.n_episodes,
        )

    def close(self) -> None:
        """Release the folder to other processes."""
        self._lock.close()
