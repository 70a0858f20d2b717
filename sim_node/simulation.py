"""One robot on one terrain: `reset()` and `step(actuation)` return the voxels' sensor readings.

An engine computes the physics, see `sim_node.engine`; checks, sensors, noise and faults are the
same for all engines.
"""

from collections.abc import Sequence

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.engine import DEFAULT_ENGINE, RobotArrays, check_engine
from sim_node.errors import InvalidInput
from sim_node.model.body_faults import (
    BodyFaults,
    Disturbance,
    FaultsOfBody,
    break_values,
    disturb_readings,
)
from sim_node.model.material import Material
from sim_node.model.meetings import note_meetings, table_of_meetings, walls_of
from sim_node.model.morphology import Morphology, parse_morphology
from sim_node.model.sensing import sense_robot, sensing_of_one
from sim_node.model.sensors import DEFAULT_SENSORS, center_of_mass
from sim_node.model.solver import Solver
from sim_node.model.terrain import DEFAULT_TERRAIN, Terrain, parse_terrain
from sim_node.walls import Walls


class Diverged(ArithmeticError):
    """The physics diverged: values are not finite or out of bounds. The episode cannot continue."""


class Simulation:
    """One robot on one terrain.

    Args:
        morphology: shape name, grid string or `Morphology`.
        terrain: terrain name or `Terrain`.
        material: physical constants.
        solver: sub-steps, iterations and self-collision.
        sensor_noise, broken_sensors, broken_actuators, seed: faults, see `FaultsOfBody` and
            docs/robustness.md; `reset` restarts them.
        engine: name of a physics engine, one of `sim_node.engine.ENGINES`.
        push: 0, or the seed of a pushed start: every mass begins up to `sim_node.model.body.PUSH`
            away from its place in x and in y. The closed loop is chaotic, so each push leads to
            another walk of the same robot, and a mean over several pushes describes the robot
            better than one episode.
        sensors: names of the sensors of each voxel, of `sim_node.model.sensors.SENSORS`.

    Attributes:
        sensors: names of the sensors, in the order of the readings.
        sensing: state of the sensors, which compiled code reads.
        engine: name of the engine.
        backend: the engine, an `Engine`.
        feet_of_walls: x [m] of the feet of both walls, (2,).
        meetings: (2, 1) table of the walls that the robot has met, see `walls`.

    Raises:
        InvalidInput: a name or number is invalid, or the engine does not support an option of the
            solver.
    """

    def __init__(
        self,
        morphology: str | Morphology,
        terrain: str | Terrain = DEFAULT_TERRAIN,
        *,
        material: Material | None = None,
        solver: Solver | None = None,
        sensor_noise: float = FaultsOfBody.sensor_noise,
        broken_sensors: str = FaultsOfBody.broken_sensors,
        broken_actuators: str = FaultsOfBody.broken_actuators,
        seed: int = FaultsOfBody.seed,
        engine: str = DEFAULT_ENGINE,
        push: int = 0,
        sensors: Sequence[str] = DEFAULT_SENSORS,
    ) -> None:
        if not isinstance(morphology, Morphology):
            morphology = parse_morphology(morphology)
        if not isinstance(terrain, Terrain):
            terrain = parse_terrain(terrain)
        if isinstance(push, bool) or not isinstance(push, int) or push < 0:
            raise InvalidInput('push', push, 'an integer from 0')
        self.morphology, self.terrain, self.engine = morphology, terrain, engine
        self.material = material or Material()
        self.solver = solver or Solver()
        self.push = push
        engine_class = check_engine(engine, self.solver)
        faults = FaultsOfBody(
            broken_sensors=broken_sensors, broken_actuators=broken_actuators,
            sensor_noise=sensor_noise, seed=seed,
        )
        self.sensing = sensing_of_one(sensors, morphology.n_voxels)
        self.sensors = tuple(sensors)
        self._faults = BodyFaults(morphology, faults, len(self.sensors))
        self.backend = engine_class(morphology, terrain, self.material, self.solver, push)
        self.step_count = 0
        self.feet_of_walls = terrain.feet_of_walls
        self.reset()

    def reset(self) -> np.ndarray:
        """Place the robot at rest and return its first readings, (n_voxels, n_sensors).

        With the same actuation, every episode from a reset on is the same, bit for bit.
        """
        self.backend.reset()
        self.step_count = 0
        self.meetings = table_of_meetings(1)
        self._faults.reset()
        self._sense(0)
        readings = self.readings
        disturb_readings(readings, readings, self._faults.draw(-1, 1), 0)
        return readings.copy()

    def step(self, actuation: np.ndarray) -> np.ndarray:
        """Apply `actuation`, (n_voxels,) in [-1, 1], for 1/60 s; return the new readings.

        Raises:
            InvalidInput: `actuation` has another shape or is not finite.
            Diverged: the physics diverged.
        """
        expected = f'{self.morphology.n_voxels} finite values'
        try:
            values = np.array(actuation, dtype=np.float64)
        except (TypeError, ValueError):
            raise InvalidInput('actuation', actuation, expected) from None
        if values.shape != self.world.actuation.shape or not np.isfinite(values).all():
            raise InvalidInput('actuation', values.tolist(), expected)
        disturbance, before = self.disturbance(1), self.readings.copy()
        break_values(values, disturbance.actuators[0], self.world.actuation)
        finite = self.backend.step(values, self.step_count + 1)
        sane = self._sense(self.step_count + 1)
        disturb_readings(self.readings, before, disturbance, 0)
        if not (finite and sane):
            raise Diverged(f'{self.morphology.name}: not finite at step {self.step_count + 1}')
        self.step_count += 1
        corners = np.ascontiguousarray(self.world.corners).reshape(-1, 2, 1)
        note_meetings(corners, self.feet_of_walls, self.step_count, self.meetings)
        return self.readings.copy()

    def _sense(self, step: int) -> bool:
        """Read all sensors at control step `step`; return False if the physics diverged."""
        world = self.world
        return sense_robot(self.sensing, world.masses, world.area_ratios, world.touching, step)

    def disturbance(self, n_steps: int) -> Disturbance:
        """Return the faults of the body in the next `n_steps` control steps."""
        return self._faults.draw(self.step_count, n_steps)

    @property
    def world(self) -> RobotArrays:
        """Return the state of the robot: arrays that the next `step` or `reset` overwrites."""
        return self.backend.world

    @property
    def readings(self) -> np.ndarray:
        """Return the newest readings, (n_voxels, n_sensors), which the next step overwrites."""
        return self.sensing.readings

    @property
    def walls(self) -> Walls:
        """Return the walls that the robot has met since the last reset."""
        return walls_of(self.meetings[:, 0], self.step_count)

    @property
    def time(self) -> float:
        """Return the simulated time [s]."""
        return self.step_count / CONTROL_RATE

    @property
    def center(self) -> np.ndarray:
        """Return the robot's centre of mass (x, y) [m]."""
        return np.array(center_of_mass(self.world.masses))

    @property
    def velocity(self) -> np.ndarray:
        """Return v_x and v_y [m/s] of the centre of mass."""
        return self.world.masses[:, 3:5].mean(axis=0)
