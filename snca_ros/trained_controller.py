"""A trained controller: parameters of cells, the body, and how it was evolved."""

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from sim_node.engine import DEFAULT_ENGINE
from sim_node.errors import InvalidInput, check_name
from sim_node.model.material import Material
from sim_node.model.morphology import Morphology, parse_morphology
from sim_node.model.solver import Solver
from sim_node.model.terrain import DEFAULT_TERRAIN
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller
from snca_ros.evolution.episode_set import EpisodeSet
from snca_ros.evolution.tasks import DEFAULT_TASK, TASKS
from snca_ros.faults import NO_FAULTS, Faults

if TYPE_CHECKING:
    from sim_node.simulation import Simulation


@dataclass(frozen=True, repr=False)
class TrainedController:
    """The contents of a controller file.

    Attributes:
        architecture: architecture of the cells.
        morphology: morphology of the robot.
        parameters: (n_parameters,) evolved parameters of the cells, see `layers_of`.
        terrain: name of the terrain of the evolution; if there were several, the first one.
        material, solver: options of the simulation of the evolution.
        fitness: score of the episode, or of the set of episodes, by which evolution chose the
            controller, in the unit of the task.
        chosen_by: name of the engine of that episode.
        task: name of the task of the evolution, one of `snca_ros.evolution.tasks.TASKS`.
        scores: score of that episode or set in each engine, by the name of the engine.
        wall_time: time [s] at which the robot met the wall at the end of the ground in the episode
            of `fitness`; None if it did not. Then the file does not have this field.
        seed: of the run.
        evaluations: number of episodes of the run.
        versions: versions of the packages that were used, by name, and 'code', see
            `snca_ros.versions.code_version`.
        home: morphology of the evolution if the robot has another one now, see `in_body`; else
            None, and the file does not have this field. `fitness` and `scores` are of that body.
        episode_set: the episodes of a candidate of the run; None if it was one plain episode, and
            then the file does not have this field. The body is the first one of the set.
        n_episodes: number of episodes of `fitness`.

    Raises:
        InvalidInput: the task is not registered in this process.
    """

    architecture: Architecture
    morphology: Morphology
    parameters: np.ndarray
    terrain: str = DEFAULT_TERRAIN
    material: Material = field(default_factory=Material)
    solver: Solver = field(default_factory=Solver)
    fitness: float = float('nan')
    seed: int = 0
    evaluations: int = 0
    versions: dict[str, str] = field(default_factory=dict)
    chosen_by: str = 'pymunk'
    task: str = DEFAULT_TASK
    scores: dict[str, float] = field(default_factory=dict)
    wall_time: float | None = None
    home: Morphology | None = None
    episode_set: EpisodeSet | None = None
    n_episodes: int = 1

    def __post_init__(self) -> None:
        check_name('task', self.task, TASKS)

    def __repr__(self) -> str:
        cell = self.architecture
        return (
            f'TrainedController({self.morphology.label}, {self.morphology.n_voxels} voxels, '
            f'{cell.name} {cell.neuron_model}, {len(self.parameters)} parameters, {self.evolved} '
            f'to {self.achieved})'
        )

    @property
    def achieved(self) -> str:
        """Return the fitness with quantity and unit, such as 'v_x 8.213 m/s'.

        It names the set of episodes of the fitness, as in 'mean v_x 6.100 m/s over 24 episodes',
        and says when the robot met the wall at the end of the ground.
        """
        task = TASKS.find(self.task)
        quantity, over = task.quantity, ''
        if self.episode_set is not None:
            quantity, over = self.episode_set.described(task.quantity, self.n_episodes)
        wall = '' if self.wall_time is None else f' (met the wall at {self.wall_time:.2f} s)'
        return f'{quantity} {task.in_unit(self.fitness)}{over}{wall}'

    @property
    def evolved(self) -> str:
        """Return where it was evolved: 'evolved on flat', or 'evolved as biped on flat'."""
        return f'evolved {f"as {self.home.label} " if self.home else ""}on {self.terrain}'

    def in_body(self, body: str | Morphology) -> 'TrainedController':
        """Return the controller in another body.

        Each voxel of the body has the cell of a uniform controller. The cells of a non-uniform one
        fit its own body alone, which may lack voxels: the others keep their parameters.

        Args:
            body: a shape or grid as for `parse_morphology`, '' for its own body; or a morphology.

        Raises:
            InvalidInput: there is no such shape, or the controller is non-uniform and was evolved
                for other voxels.
        """
        if not body:
            return self
        morphology = parse_morphology(body) if isinstance(body, str) else body
        own, home = self.morphology, self.home or self.morphology
        if morphology.grid_string == own.grid_string:
            return self
        parameters = self.parameters
        if not self.architecture.uniform:
            if morphology.complete != own.complete or not {*morphology.squares} < {*own.squares}:
                expected = f'{own.grid_string}, or less of it, since each cell has its own weights'
                raise InvalidInput('shape', morphology.grid_string, expected)
            kept = [own.squares.index(square) for square in morphology.squares]
            parameters = parameters.reshape(own.n_voxels, -1)[kept].ravel()
        away = None if morphology.grid_string == home.grid_string else home
        return replace(self, morphology=morphology, parameters=parameters, home=away)

    def without(self, names: str | Iterable[str]) -> 'TrainedController':
        """Return the controller in its body without some voxels; the others keep their names.

        Args:
            names: names of voxels, or a text with commas between them; none or '' for all voxels.

        Raises:
            InvalidInput: there is no such voxel, or the others are not one connected piece.
        """
        return self.in_body(self.morphology.without(names))

    def in_arithmetic(self, name: str) -> 'TrainedController':
        """Return the controller with cells that compute in another arithmetic.

        Args:
            name: one of `snca_ros.cell.models.arithmetic.ARITHMETICS`.

        Raises:
            InvalidInput: there is no such arithmetic, or the neuron model has no equations in it.
        """
        return replace(self, architecture=replace(self.architecture, arithmetic=name))

    def controller(self, faults: Faults | None = None) -> Controller:
        """Return a controller with all cells of the robot."""
        return Controller(self.architecture, self.morphology, self.parameters, faults)

    def simulation(
        self,
        terrain: str = '',
        engine: str = DEFAULT_ENGINE,
        push: int = 0,
        faults: Faults = NO_FAULTS,
    ) -> 'Simulation':
        """Return the simulation of the robot at its start.

        Args:
            terrain: name of the terrain; '' for that of the evolution.
            engine: one of `sim_node.engine.ENGINES`.
            push: 0, or the seed of a pushed start, see `Simulation`.
            faults: faults, of which those of the body are applied; `controller` takes the others.

        Raises:
            InvalidInput: a value is invalid.
        """
        # Imported here, since it imports pymunk, which voxel nodes do not need.
        from sim_node.simulation import Simulation

        return Simulation(
            self.morphology, terrain or self.terrain, material=self.material, solver=self.solver,
            engine=engine, push=push, sensors=self.architecture.sensors, **faults.of_body,
        )
