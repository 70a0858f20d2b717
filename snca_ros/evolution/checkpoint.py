"""The run folder: config.yaml, checkpoint.npz, history.csv, best.npz.

checkpoint.npz is the one truth, replaced atomically once a generation; history.csv and best.npz
are written from it, so that a run killed at any moment goes on as if it had never stopped.
"""

import csv
import io
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.morphology import parse_morphology
from snca_ros.controller_file import TrainedController, save_controller
from snca_ros.evolution.config import RunConfig
from snca_ros.files import LOCK, hold_folder, write_atomically, write_text

HISTORY = ('generation', 'evaluations', 'best', 'median', 'worst', 'best_so_far')
"""Columns of history.csv; fitness values are v_x [m/s] of the generation's evaluations."""


def _unwritable(path: Path, error: OSError) -> InvalidInput:
    reason = 'a file' if path.is_file() else error.strerror
    return InvalidInput('run', reason, 'a folder that can be written', str(path))


@dataclass
class Progress:
    """Where a run stands.

    Attributes:
        strategy: the strategy's state.
        history: a row of `HISTORY` per generation.
        reassessed: v_x [m/s] of the best quarter in the pymunk engine, best of the run's engine
            first; empty before the end, and of runs in that engine.
    """

    strategy: dict[str, np.ndarray] = field(default_factory=dict)
    history: list[tuple[float, ...]] = field(default_factory=list)
    reassessed: np.ndarray = field(default_factory=lambda: np.empty(0))

    @property
    def evaluations(self) -> int:
        """Return the evaluations spent."""
        return int(self.history[-1][1]) if self.history else 0

    def chosen(self, engine: str) -> tuple[int, str, dict[str, float]]:
        """Return the number of the best individual, the engine that says so, and its v_x in each.

        Args:
            engine: that of the run.
        """
        fitness = self.strategy['fitness']
        if not len(self.reassessed):
            return 0, engine, {engine: float(fitness[0])}
        i = int(np.argmax(self.reassessed))
        return i, 'pymunk', {engine: float(fitness[i]), 'pymunk': float(self.reassessed[i])}


class RunFolder:
    """The folder of one run, held against a second process while it is open.

    Use `create`, `resume` or `create_or_resume`; close it when done.
    """

    def __init__(self, path: Path, config: RunConfig, wait: bool = False) -> None:
        self.path, self.config = path, config
        try:
            self._lock = hold_folder(path, 'run', wait)
        except OSError as error:
            raise _unwritable(path, error) from None

    @classmethod
    def create(cls, path: Path, config: RunConfig, wait: bool = False) -> 'RunFolder':
        """Make a new run folder; InvalidInput if there is one already."""
        try:
            path.mkdir(parents=True, exist_ok=True)
            # A run killed before it had its config.yaml leaves no more than this.
            if any(p.name != LOCK and not p.match('.config.yaml.*.tmp') for p in path.iterdir()):
                expected = 'a new or empty folder (add --resume to go on with the run in it)'
                raise InvalidInput('run', 'files in it', expected, str(path))
            folder = cls(path, config, wait)
            write_text(path / 'config.yaml', config.to_yaml())
        except OSError as error:
            raise _unwritable(path, error) from None
        return folder

    @classmethod
    def resume(cls, path: Path, wait: bool = False) -> 'RunFolder':
        """Open the run folder of a run that was stopped; InvalidInput if there is none."""
        if not path.is_dir():
            raise InvalidInput('run', 'no folder', 'the folder of an earlier run', str(path))
        if not (path / 'config.yaml').exists():
            raise InvalidInput('config.yaml', None, 'the folder of an earlier run', str(path))
        return cls(path, RunConfig.from_yaml(path / 'config.yaml'), wait)

    @classmethod
    def create_or_resume(cls, path: Path, config: RunConfig) -> 'RunFolder':
        """Open the folder of a run, new or not; wait for another process to leave it.

        Raises:
            InvalidInput: the run in it has another configuration.
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
        """Return where the run stands, and mend history.csv and best.npz after a kill."""
        path = self.path / 'checkpoint.npz'
        if not path.exists():
            return Progress()
        try:
            with np.load(path, allow_pickle=False) as data:
                arrays = {name: data[name] for name in data.files}
            self._check(arrays)
            rows, reassessed = arrays.pop('history'), arrays.pop('reassessed')
            progress = Progress(arrays, [tuple(row) for row in rows.tolist()], reassessed)
        except InvalidInput as error:
            raise error.found_in(str(path)) from None
        except Exception as error:
            expected = 'a checkpoint written by evolve'
            raise InvalidInput('file', str(error), expected, str(path)) from None
        self._write_views(progress)
        return progress

    def _check(self, arrays: dict[str, np.ndarray]) -> None:
        config = self.config
        arrays.setdefault('reassessed', np.empty(0))  # runs from before there were two engines
        n = min(len(arrays.get('individuals', ())), config.population)
        expected = {
            'individuals': (n, config.n_parameters),
            'fitness': (n,),
            'history': (int(arrays.get('generation', np.array(0)).flat[0]), len(HISTORY)),
            'generation': (),
            'reassessed': (min(len(arrays['reassessed']), config.n_elite),),
        }
        if config.strategy == 'cma':
            expected['told'] = (expected['history'][0], config.population)
            expected['mean'] = (config.n_parameters,)
        if arrays.keys() != expected.keys():
            raise InvalidInput('entries', sorted(arrays), ', '.join(sorted(expected)))
        for name, shape in expected.items():
            array, kind = arrays[name], 'i' if name == 'generation' else 'f'
            missing = 0 in shape and name != 'reassessed'
            if array.shape != shape or array.dtype.kind != kind or missing:
                shown = f'{array.dtype} of shape {array.shape}'
                raise InvalidInput(name, shown, f'numbers of shape {shape}, none of them 0')
        fitness, spent = arrays['fitness'], arrays['history'][:, 1]
        if not np.isfinite(arrays['individuals']).all():
            raise InvalidInput('individuals', 'not finite', 'finite numbers')
        if not (fitness[:-1] >= fitness[1:]).all() or np.isnan(fitness).any():
            raise InvalidInput('fitness', fitness.tolist(), 'numbers, the best first')
        if not (np.diff(spent, prepend=0) > 0).all() or not spent[-1] <= config.evaluations:
            raise InvalidInput('history', spent.tolist(), f'up to {config.evaluations} evaluations')

    def save(self, progress: Progress) -> None:
        """Replace the checkpoint, then history.csv and best.npz."""
        arrays = {
            **progress.strategy,
            'history': np.array(progress.history), 'reassessed': progress.reassessed,
        }
        write_atomically(
            self.path / 'checkpoint.npz',
            lambda file: np.savez(file, **arrays),  # type: ignore[arg-type]
        )
        self._write_views(progress)

    def _write_views(self, progress: Progress) -> None:
        text = io.StringIO()
        writer = csv.writer(text, lineterminator='\n')
        writer.writerow(HISTORY)
        for generation, evaluations, *scores in progress.history:
            writer.writerow([int(generation), int(evaluations), *map(repr, scores)])
        write_text(self.path / 'history.csv', text.getvalue())
        config = self.config
        best, chosen_by, v_x = progress.chosen(config.engine)
        trained = TrainedController(
            architecture=config.architecture,
            morphology=parse_morphology(config.shape),
            theta=progress.strategy['individuals'][best],
            terrain=config.terrain,
            material=config.material,
            solver=config.solver,
            fitness=v_x[chosen_by],
            seed=config.seed,
            evaluations=progress.evaluations,
            chosen_by=chosen_by,
            v_x=v_x,
        )
        save_controller(self.path / 'best.npz', trained)

    def close(self) -> None:
        """Let another process have the folder."""
        self._lock.close()
