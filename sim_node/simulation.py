"""One robot on one terrain: `reset()` and `step(actuation)` give the voxels' sensor readings.

This is the seam behind which an engine stands. `World` is what compiled code needs of the pymunk
engine; `advance` is one control step on it, called by `Simulation.step` and by whole episodes.
"""

from typing import NamedTuple

import numpy as np

from sim_node.batched.engine import OneRobot, Robots, one_robot
from sim_node.control_time import CONTROL_RATE
from sim_node.errors import InvalidInput
from sim_node.model.body import build_body, pushed
from sim_node.model.body_faults import BodyFaults, Disturbance, break_values, disturb_readings
from sim_node.model.collision import touches_ground
from sim_node.model.ground_polygons import polygon_rows
from sim_node.model.material import Material
from sim_node.model.morphology import Morphology, parse_morphology
from sim_node.model.sensors import (
    MAX_AREA_RATIO,
    N_SENSORS,
    measure,
    normalise,
    outer_corners,
    polygon_area,
    sample_windows,
)
from sim_node.model.solver import Solver, check_engine
from sim_node.model.terrain import Terrain, parse_terrain
from sim_node.munk2d import c_functions as munk
from sim_node.munk2d.space import Space
from sim_node.numerics.jit import compiled


class Diverged(ArithmeticError):
    """The physics left the finite numbers, or all bounds; the episode cannot go on."""


class World(NamedTuple):
    """Everything that one control step reads and writes; arrays are shared, never copied."""

    space: int  # handles are pointers of Munk2D as integers
    bodies: np.ndarray  # (n_masses,) handles
    springs: np.ndarray  # (n_springs,) handles
    rest: np.ndarray  # (3, n_springs) rest lengths [m] contracted, at rest, expanded
    actuation: np.ndarray  # (n_voxels,) as set in the springs now
    dt: float  # physics step [s]
    substeps: int
    current_poses: bool  # bodies move at the end of a physics step, not at the start of the next
    read_body: int  # addresses of the iterators that `sense` hands to Munk2D
    note_contact: int
    batch: int  # handle of the body reader
    filled: np.ndarray  # (1,) its fill count
    masses: np.ndarray  # (n_masses, 5) x, y, angle, v_x, v_y
    contact: np.ndarray  # (4,) ground's handle, touching flag, scratch
    half_side: float  # of a mass [m]
    rest_area: float  # [m^2]
    polygons: np.ndarray  # (n_polygons, 8) of the ground, see `polygon_rows`
    left_sides: np.ndarray  # (n_polygons,) x [m], increasing
    corners: np.ndarray  # (n_voxels, 4, 2) outer corners [m]
    area_ratios: np.ndarray  # (n_voxels,)
    touching: np.ndarray  # (n_voxels,) 0.0 or 1.0
    touches: np.ndarray  # ring buffers of the sensors
    velocities: np.ndarray
    readings: np.ndarray  # (n_voxels, 4) in [0, 1]


@compiled
def set_rest_lengths(world, actuation):
    """Contract (a > 0) or expand (a < 0) every spring of each voxel, a clipped to [-1, 1]."""
    per_voxel = world.springs.shape[0] // actuation.shape[0]
    for i in range(actuation.shape[0]):
        a = min(max(actuation[i], -1.0), 1.0)
        if a == world.actuation[i]:
            continue
        world.actuation[i] = a
        extreme = 0 if a > 0.0 else 2
        for j in range(i * per_voxel, (i + 1) * per_voxel):
            rest = world.rest[1, j]
            length = rest + (world.rest[extreme, j] - rest) * abs(a)
            munk.store_real(world.springs[j] + munk.REST_LENGTH, length)


@compiled
def step_physics(world):
    """Advance the physics by one physics step."""
    munk.space_step(world.space, world.dt)
    if world.current_poses:
        for i in range(world.bodies.shape[0]):
            munk.body_update_position(world.bodies[i], world.dt)


@compiled
def _touches(world, voxel):
    """Tell whether one of a voxel's masses touches the ground, at the poses that were read."""
    if world.current_poses:
        for i in range(4 * voxel, 4 * voxel + 4):
            if touches_ground(world.masses[i], world.half_side, world.polygons, world.left_sides):
                return True
        return False
    world.contact[1] = 0
    for i in range(4 * voxel, 4 * voxel + 4):
        munk.body_each_arbiter(world.bodies[i], world.note_contact, world.contact.ctypes.data)
    return world.contact[1] != 0


@compiled
def sense(world, step):
    """Read the bodies and write sensor readings; return False if the physics diverged.

    It has when a number is not finite or a voxel's area is a hundred times that at rest.
    """
    world.filled[0] = 0
    munk.space_each_body(world.space, world.read_body, world.batch)
    outer_corners(world.masses, world.half_side, world.corners.reshape(-1, 2))
    for i in range(world.readings.shape[0]):
        voxel = world.masses[4 * i : 4 * i + 4]
        world.area_ratios[i] = polygon_area(world.corners[i]) / world.rest_area
        world.touching[i] = 1.0 if _touches(world, i) else 0.0
        measure(
            voxel,
            step,
            world.touching[i],
            world.area_ratios[i],
            world.touches[i],
            world.velocities[i],
            world.readings[i],
        )
    normalise(world.readings.reshape(-1))
    for i in range(world.area_ratios.shape[0]):
        if not abs(world.area_ratios[i]) < MAX_AREA_RATIO:
            return False
    return bool(np.isfinite(world.readings.sum()))


@compiled
def advance(world, actuation, step, disturbance, row):
    """Apply `actuation`, step the physics to control step `step` and read the sensors.

    Args:
        actuation: (n_voxels,) in [-1, 1]; written where actuators are broken.
        disturbance: what befalls the body in this step, in its row `row`.

    Returns:
        False if the physics diverged, else True.
    """
    break_values(actuation, disturbance.actuators[row], world.actuation)
    before = world.readings.copy() if disturbance.sensors.shape[1] > 0 else world.readings
    set_rest_lengths(world, actuation)
    for _ in range(world.substeps):
        step_physics(world)
    finite = sense(world, step)
    disturb_readings(world.readings, before, disturbance, row)
    return finite


@compiled
def center(world):
    """Return the robot's centre of mass (x, y) [m]; all masses weigh the same."""
    x = y = 0.0
    for i in range(world.masses.shape[0]):
        x += world.masses[i, 0]
        y += world.masses[i, 1]
    return x / world.masses.shape[0], y / world.masses.shape[0]


class Simulation:
    """One robot on one terrain.

    Args:
        morphology: shape name, grid string or `Morphology`.
        terrain: terrain name or `Terrain`.
        material: physical constants.
        solver: sub-steps, iterations and self-collision.
        sensor_noise: standard deviation of N(0, sigma) added to readings.
        broken_sensors, broken_actuators: which voxels', when and how; see docs/robustness.md.
        seed: of all noise and faults; every `reset` starts them anew.
        engine: one of `sim_node.model.solver.ENGINES`.
        push: 0, or the seed of a pushed start: every mass begins up to `sim_node.model.body.PUSH`
            away from its place in x and in y. The closed loop is chaotic, so each push is another
            walk of the same robot, and the mean over several says more than the one episode.

    Attributes:
        world: what the engine reads and writes.
        space: of the pymunk engine, the space of ground and robot since the last `reset`.

    Raises:
        InvalidInput: a name or number is off, or the batched engine is asked for self-collision.
    """

    world: World | OneRobot

    def __init__(
        self,
        morphology: str | Morphology,
        terrain: str | Terrain = 'flat',
        *,
        material: Material | None = None,
        solver: Solver | None = None,
        sensor_noise: float = 0.0,
        broken_sensors: str = '',
        broken_actuators: str = '',
        seed: int = 0,
        engine: str = 'pymunk',
        push: int = 0,
    ) -> None:
        if not isinstance(morphology, Morphology):
            morphology = parse_morphology(morphology)
        if not isinstance(terrain, Terrain):
            terrain = parse_terrain(terrain)
        if isinstance(push, bool) or not isinstance(push, int) or push < 0:
            raise InvalidInput('push', push, 'an integer from 0')
        check_engine(engine, solver or Solver())
        self.morphology, self.terrain, self.engine = morphology, terrain, engine
        self.material = material or Material()
        self.solver = solver or Solver()
        self.push = push
        self._faults = BodyFaults(morphology, sensor_noise, broken_sensors, broken_actuators, seed)
        if engine == 'batched':
            self._robots = Robots(morphology, terrain, self.material, self.solver, 1, push)
        else:
            self._body = pushed(build_body(morphology, terrain, self.material), push)
            self._ground = terrain.polygons
            self._polygons = polygon_rows(self._ground)
        self.step_count = 0
        self.reset()

    def reset(self) -> np.ndarray:
        """Put a fresh robot down at rest and return its first readings, (n_voxels, 4).

        The world is built anew: the same robot on the same terrain always repeats bit for bit.
        """
        if self.engine == 'batched':
            self._robots.reset()
            self.world = one_robot(self._robots.group)
        else:
            self.world = self._new_world()
            sense(self.world, 0)
        self.step_count = 0
        self._faults.reset()
        disturb_readings(self.world.readings, self.world.readings, self._faults.draw(-1, 1), 0)
        return self.world.readings.copy()

    def _new_world(self) -> World:
        n, m = self.morphology.n_voxels, self.material
        space = Space(self._body, self._ground, m, self.solver)
        reader = munk.BodyReader(len(space.bodies))
        touches, velocities = sample_windows(n)
        self.space, self._reader = space, reader  # keep alive what the handles point to
        return World(
            space=space.handle,
            bodies=space.bodies,
            springs=space.springs,
            rest=self._body.rest_lengths.copy(),
            actuation=np.zeros(n),
            dt=1.0 / CONTROL_RATE / self.solver.substeps,
            substeps=self.solver.substeps,
            current_poses=self.solver.rules.current_poses,
            read_body=munk.READ_BODY,
            note_contact=munk.NOTE_CONTACT,
            batch=reader.batch,
            filled=reader.filled,
            masses=reader.rows,
            contact=np.array([space.ground, 0, 0, 0], dtype=np.uintp),
            half_side=m.mass_side / 2.0,
            rest_area=m.side**2,
            polygons=self._polygons,
            left_sides=np.ascontiguousarray(self._ground[:, 0, 0]),
            corners=np.zeros((n, 4, 2)),
            area_ratios=np.zeros(n),
            touching=np.zeros(n),
            touches=touches,
            velocities=velocities,
            readings=np.zeros((n, N_SENSORS)),
        )

    def step(self, actuation: np.ndarray) -> np.ndarray:
        """Apply `actuation`, (n_voxels,) in [-1, 1], for 1/60 s; return the new readings.

        Raises:
            InvalidInput: `actuation` has another shape or is not finite.
            Diverged: the physics is no longer finite.
        """
        expected = f'{self.morphology.n_voxels} finite values'
        try:
            values = np.array(actuation, dtype=np.float64)
        except (TypeError, ValueError):
            raise InvalidInput('actuation', actuation, expected) from None
        if values.shape != self.world.actuation.shape or not np.isfinite(values).all():
            raise InvalidInput('actuation', values.tolist(), expected)
        disturbance = self.disturbance(1)
        if self.engine == 'batched':
            break_values(values, disturbance.actuators[0], self.world.actuation)
            before = self.world.readings.copy()
            self._robots.step(values[:, None])
            disturb_readings(self.world.readings, before, disturbance, 0)
            finite = self._robots.sane[0]
        else:
            finite = advance(self.world, values, self.step_count + 1, disturbance, 0)
        if not finite:
            raise Diverged(f'{self.morphology.name}: not finite at step {self.step_count + 1}')
        self.step_count += 1
        return self.world.readings.copy()

    def disturbance(self, n_steps: int) -> Disturbance:
        """Return what befalls the body in the next control steps."""
        return self._faults.draw(self.step_count, n_steps)

    @property
    def time(self) -> float:
        """Return the simulated time [s]."""
        return self.step_count / CONTROL_RATE

    @property
    def center(self) -> np.ndarray:
        """Return the robot's centre of mass (x, y) [m]."""
        return np.array(center(self.world))

    @property
    def velocity(self) -> np.ndarray:
        """Return v_x and v_y [m/s] of the centre of mass."""
        return self.world.masses[:, 3:5].mean(axis=0)
