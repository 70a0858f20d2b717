"""The interface of physics engines, and the registry of engines.

An engine steps one robot on one terrain; `sim_node.simulation.Simulation` does the rest (checks,
sensors, faults, noise) in the same way for all engines. To add an engine, derive from `Engine` and
call `ENGINES.register`, see `sim_node.registry`. The module of an engine is imported only when the
engine is used.
"""

from abc import ABC, abstractmethod
from typing import ClassVar, Protocol

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.material import Material
from sim_node.model.morphology import Morphology
from sim_node.model.solver import Solver
from sim_node.model.terrain import Terrain
from sim_node.registry import Registry


class RobotArrays(Protocol):
    """The state of a robot in its engine: an object of any type that has these arrays."""

    @property
    def masses(self) -> np.ndarray:
        """Return x, y [m], angle [rad], v_x and v_y [m/s] of each mass, (n_masses, 5).

        There are four masses per voxel: NW, NE, SE, SW.
        """

    @property
    def corners(self) -> np.ndarray:
        """Return the outer corners [m] of each voxel: NW, NE, SE, SW, (n_voxels, 4, 2)."""

    @property
    def area_ratios(self) -> np.ndarray:
        """Return each voxel's area, relative to its area at rest, (n_voxels,)."""

    @property
    def touching(self) -> np.ndarray:
        """Return 1.0 for each voxel that touches the ground, else 0.0, (n_voxels,)."""

    @property
    def actuation(self) -> np.ndarray:
        """Return the actuation of the last step, clipped to [-1, 1], (n_voxels,)."""


class Engine(ABC):
    """A physics engine, which steps one robot on one terrain.

    Args of the constructor (the robot is placed by `reset`):
        morphology: morphology of the robot.
        terrain: the ground.
        material: physical constants.
        solver: sub-steps, iterations, physics; `self_collision` only if the class declares it.
        push: 0, or the seed of a pushed start, see `sim_node.model.body.pushed`.

    Attributes:
        world: the state of the robot, valid from the first `reset` on. `Simulation` and the sensors
            read it after each call.
    """

    self_collision: ClassVar[bool] = False
    """Whether masses of the robot can collide with each other."""

    lanes: ClassVar[tuple[int, ...]] = (1,)
    """Numbers of robots that can be stepped side by side in an evaluation, increasing."""

    world: RobotArrays

    @abstractmethod
    def __init__(
        self,
        morphology: Morphology,
        terrain: Terrain,
        material: Material,
        solver: Solver,
        push: int = 0,
    ) -> None: ...

    @abstractmethod
    def reset(self) -> None:
        """Put the robot down at rest, as if it had never moved."""

    @abstractmethod
    def step(self, actuation: np.ndarray, step: int) -> bool:
        """Apply `actuation` for one control step of 1/60 s.

        Args:
            actuation: (n_voxels,) finite; values beyond [-1, 1] count as -1 and 1.
            step: number of the control step; the first after a reset is 1.

        Returns:
            False if the physics diverged and the robot cannot continue before the next reset.
            `Simulation` itself detects readings that are not finite and areas out of bounds.
        """


DEFAULT_ENGINE = 'pymunk'
"""The default engine: the reference, which supports all options of the solver."""

ENGINES = Registry[type[Engine]]('engine', {
    DEFAULT_ENGINE: 'sim_node.munk2d.engine:PymunkEngine',
    'batched': 'sim_node.batched.engine:BatchedEngine',
})
"""Engines by name."""


def check_engine(name: str, solver: Solver) -> type[Engine]:
    """Return the engine of that name, after a check that it supports the solver's options.

    Raises:
        InvalidInput: there is no such engine, or it does not support an option.
    """
    engine = ENGINES.find(name)
    if solver.self_collision and not engine.self_collision:
        able = next(other for other in ENGINES if ENGINES[other].self_collision)
        expected = f'false with the {name} engine; only the {able} engine has self-collision'
        raise InvalidInput('solver.self_collision', solver.self_collision, expected)
    return engine
