"""A trained robot, which can be loaded, run and saved."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.engine import DEFAULT_ENGINE
from sim_node.errors import InvalidInput
from sim_node.model.morphology import Morphology
from snca_ros.bundled import find_controller
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import load_controller, save_controller
from snca_ros.evolution.episode import EPISODE, LONGEST
from snca_ros.faults import Faults, parse_faults
from snca_ros.recording.episode import RecordedEpisode, names_to_record
from snca_ros.recording.offline import record_episode
from snca_ros.trained_controller import TrainedController


@dataclass(frozen=True, eq=False, repr=False)
class Robot:
    """A trained robot: a body and cells, from `load` or `evolve`.

    Attributes:
        trained: the contents of its controller file.
        name: name of the file or run, for display.
    """

    trained: TrainedController
    name: str

    @property
    def morphology(self) -> Morphology:
        """Return the morphology of the body."""
        return self.trained.morphology

    @property
    def architecture(self) -> Architecture:
        """Return the architecture of the cells."""
        return self.trained.architecture

    @property
    def parameters(self) -> np.ndarray:
        """Return the evolved parameters of the cells, (n_parameters,)."""
        return self.trained.parameters

    @property
    def terrain(self) -> str:
        """Return the name of the terrain on which it was evolved."""
        return self.trained.terrain

    def in_body(self, body: str | Morphology) -> 'Robot':
        """Return the robot in another body, each voxel of which has the cell of this one.

        Args:
            body: name such as 'tripod' or 'comb-9x3', a grid such as '1111-1001', or a morphology.

        Raises:
            InvalidInput: there is no such shape, or the cells are non-uniform, each for its voxel.
        """
        trained = self.trained.in_body(body)
        if trained is self.trained:
            return self
        return Robot(trained, f'{self.name} in {trained.morphology.label}')

    def without(self, *voxels: str) -> 'Robot':
        """Return the robot without some voxels; the others keep their names and their cells.

        Args:
            voxels: their names, such as 'voxel_1_1'.

        Raises:
            InvalidInput: there is no such voxel, or the others are not one connected piece.
        """
        trained = self.trained.without(voxels)
        if trained is self.trained:
            return self
        return Robot(trained, f'{self.name} without {", ".join(voxels)}')

    def run(
        self,
        duration: float = EPISODE,
        record: str | Iterable[str] = (),
        *,
        terrain: str = '',
        faults: str | Faults = '',
        engine: str = DEFAULT_ENGINE,
        push: int = 0,
    ) -> RecordedEpisode:
        """Run one episode; the same call gives the same numbers, to the bit.

        Args:
            duration: simulated time [s], from 1/60 to 3600.
            record: arrays to record besides `centers`: one or several of 'readings', 'actuation',
                'spikes', 'values', 'corners' and 'thresholds', or 'all'.
            terrain: name of the terrain, such as 'hilly-1-10-0'; '' for that of its evolution.
            faults: faults, such as 'loss=0.3,death=0.5@10', see docs/robustness.md.
            engine: one of `sim_node.engine.ENGINES`, such as 'batched'.
            push: 0, or the seed of a pushed start, which leads to another walk of the robot.

        Raises:
            InvalidInput: a value is invalid. If the physics diverges, there is no error, but the
                episode has `diverged` set.
        """
        _check_duration(duration)
        names, given = names_to_record(record), as_faults(faults)
        simulation = self.trained.simulation(terrain, engine, push, given)
        return record_episode(
            simulation, self.trained.controller(given), duration, names, self.name
        )

    def save(self, path: str | Path) -> None:
        """Write the robot's controller file (.npz), which `load` and the commands read."""
        try:
            save_controller(path, self.trained)
        except OSError as error:
            raise InvalidInput(
                'path', str(path), f'a file that can be written ({error.strerror})'
            ) from None

    def __repr__(self) -> str:
        trained, cell = self.trained, self.architecture
        return (
            f"Robot('{self.name}': {self.morphology.label}, {self.morphology.n_voxels} voxels, "
            f'{cell.name} {cell.neuron_model}, {trained.evolved} to {trained.achieved})'
        )


def load(controller: str | Path) -> Robot:
    """Load a trained robot.

    Args:
        controller: name of a bundled controller such as 'biped-U-nD-snn-h', a controller file
            (.npz), or the folder of a run of `evolve`, for its best robot.

    Raises:
        InvalidInput: there is no such file, or it is damaged or invalid.
    """
    folder = Path(controller)
    if (folder / 'config.yaml').exists():
        return Robot(load_controller(folder / 'best.npz'), folder.resolve().name)
    path = find_controller(str(controller))
    return Robot(load_controller(path), path.stem)


def as_faults(faults: str | Faults) -> Faults:
    """Return `faults`, parsed if they are a text; InvalidInput if the text is invalid."""
    if isinstance(faults, Faults):
        return faults
    if not isinstance(faults, str):
        raise InvalidInput('faults', faults, "a text such as 'loss=0.3', or Faults")
    return parse_faults(faults)


def _check_duration(duration: float) -> None:
    is_number = isinstance(duration, (int, float)) and not isinstance(duration, bool)
    if not is_number or not 1 / CONTROL_RATE <= duration <= LONGEST:
        raise InvalidInput('duration', duration, f'seconds from 1/60 to {LONGEST:g}')
