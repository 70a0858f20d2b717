"""What a physics engine is: a class of a few methods, found by its name.

An engine steps one robot on one terrain; `sim_node.simulation.Simulation` does all else (checks,
sensors, faults, noise) alike for every engine. To add one, derive from `Engine` and call
`ENGINES.register`, see `sim_node.registry`.
Nothing here, and nothing that asks for an engine by its name, imports an engine that is not used.
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
    """What an engine shows of its robot; an object of any type that has these arrays."""

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
        """Return each voxel's area, relative to that at rest, (n_voxels,)."""

    @property
    def touching(self) -> np.ndarray:
        """Return 1.0 for each voxel that touches the ground, else 0.0, (n_voxels,)."""

    @property
    def actuation(self) -> np.ndarray:
        """Return the actuation of the last step, clipped to [-1, 1], (n_voxels,)."""


class Engine(ABC):
    """One robot on one terrain, stepped by some physics.

    Args of the constructor, which need not put the robot down yet:
        morphology: shape of the robot.
        terrain: the ground.
        material: physical constants.
        solver: sub-steps, iterations, physics; `self_collision` only if the class declares it.
        push: 0, or the seed of a pushed start, see `sim_node.model.body.pushed`.

    Attributes:
        world: the robot as arrays, from the first `reset` on. `Simulation` reads them after each
            call; the sensors read them, too.
    """

    self_collision: ClassVar[bool] = False
    """Whether masses of the robot can collide with each other."""

    lanes: ClassVar[tuple[int, ...]] = (1,)
    """How many robots may be stepped side by side, for whoever evaluates many; increasing."""

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
            False if the physics diverged: the robot cannot go on before the next reset. Readings
            that are not finite and areas beyond bounds are found by `Simulation`.
        """


DEFAULT_ENGINE = 'pymunk'
"""The engine of whoever names none: the reference, which has everything that a solver asks for."""

ENGINES = Registry[type[Engine]]('engine', {
    DEFAULT_ENGINE: 'sim_node.munk2d.engine:PymunkEngine',
    'batched': 'sim_node.batched.engine:BatchedEngine',
})
"""Engines by name."""


def check_engine(name: str, solver: Solver) -> type[Engine]:
    """Return the engine of that name if it can do what the solver asks for.

    Raises:
        InvalidInput: there is no such engine, or it cannot.
    """
    engine = ENGINES.find(name)
    if solver.self_collision and not engine.self_collision:
        able = next(other for other in ENGINES if ENGINES[other].self_collision)
        expected = f'false with the {name} engine; the {able} engine has self-collision'
        raise InvalidInput('solver.self_collision', solver.self_collision, expected)
    return engine
