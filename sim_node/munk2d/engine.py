"""The pymunk engine: compiled code that steps a robot's Munk2D space and reads its bodies.

`World` has the data of the compiled code. `PymunkEngine` steps it from Python; compiled episodes
call `move_disturbed`.
"""

from typing import NamedTuple

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.engine import Engine
from sim_node.model.body import build_body, pushed
from sim_node.model.body_faults import break_values, disturb_readings
from sim_node.model.collision import touches_ground
from sim_node.model.ground_polygons import polygon_rows
from sim_node.model.material import Material
from sim_node.model.morphology import Morphology
from sim_node.model.sensing import sense_robot
from sim_node.model.sensors import outer_corners, polygon_area
from sim_node.model.solver import Solver
from sim_node.model.terrain import Terrain
from sim_node.munk2d import c_functions as munk
from sim_node.munk2d.space import Space
from sim_node.numerics.jit import compiled


class World(NamedTuple):
    """The data that a control step reads and writes; arrays are shared, not copied."""

    space: int  # handles are pointers of Munk2D as integers
    bodies: np.ndarray  # (n_masses,) handles
    springs: np.ndarray  # (n_springs,) handles
    rest: np.ndarray  # (3, n_springs) rest lengths [m] contracted, at rest, expanded
    actuation: np.ndarray  # (n_voxels,) that the springs have now
    dt: float  # physics step [s]
    substeps: int
    current_poses: bool  # bodies move at the end of a physics step, not at the start of the next
    read_body: int  # address of the callback that reads a body
    note_contact: int  # address of the callback that checks for the ground
    batch: int  # handle of the body reader
    filled: np.ndarray  # (1,) number of bodies that it has read
    masses: np.ndarray  # (n_masses, 5) x, y, angle, v_x, v_y
    contact: np.ndarray  # (4,) the ground's handle, flag of touching it, scratch
    half_side: float  # of a mass [m]
    rest_area: float  # [m^2]
    polygons: np.ndarray  # (n_polygons, 8) of the ground, see `polygon_rows`
    left_sides: np.ndarray  # (n_polygons,) x [m], increasing
    corners: np.ndarray  # (n_voxels, 4, 2) outer corners [m]
    area_ratios: np.ndarray  # (n_voxels,)
    touching: np.ndarray  # (n_voxels,) 0.0 or 1.0


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
    """Return whether one of a voxel's masses touches the ground, at the poses in `masses`."""
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
def read_bodies(world):
    """Read the bodies: masses, corners, area ratios, and which voxels touch the ground."""
    world.filled[0] = 0
    munk.space_each_body(world.space, world.read_body, world.batch)
    outer_corners(world.masses, world.half_side, world.corners.reshape(-1, 2))
    for i in range(world.area_ratios.shape[0]):
        world.area_ratios[i] = polygon_area(world.corners[i]) / world.rest_area
        world.touching[i] = 1.0 if _touches(world, i) else 0.0


@compiled
def move(world, actuation):
    """Advance the physics by a control step and read the bodies.

    Args:
        actuation: (n_voxels,) clipped to [-1, 1].
    """
    set_rest_lengths(world, actuation)
    for _ in range(world.substeps):
        step_physics(world)
    read_bodies(world)


@compiled
def move_disturbed(world, robot, actuation, step, disturbance, row):
    """Do what `Simulation.step` does: advance the physics with faults and read the sensors.

    Args:
        robot: sensors of the robot, a `sim_node.model.sensing.RobotSensing`.
        actuation: (n_voxels,) actuation; overwritten where actuators are broken.
        step: number of the control step.
        disturbance: faults of the body.
        row: row of the `disturbance` for this step.

    Returns:
        False if the physics diverged, else True.
    """
    break_values(actuation, disturbance.actuators[row], world.actuation)
    readings = robot.readings
    before = readings.copy() if disturbance.sensors.shape[1] > 0 else readings
    move(world, actuation)
    sane = sense_robot(robot, world.masses, world.area_ratios, world.touching, step)
    disturb_readings(readings, before, disturbance, row)
    return sane


class PymunkEngine(Engine):
    """The reference engine, which supports all options of the solver.

    Attributes:
        world: data of the compiled code. Each `reset` makes a new one, so that the same robot on
            the same terrain repeats bit for bit.
        space: Munk2D space with ground and robot, new at each `reset`; `pymunk_view` draws it.
    """

    self_collision = True
    world: World
    space: Space

    def __init__(
        self,
        morphology: Morphology,
        terrain: Terrain,
        material: Material,
        solver: Solver,
        push: int = 0,
    ) -> None:
        self._n_voxels, self._material, self._solver = morphology.n_voxels, material, solver
        self._body = pushed(build_body(morphology, terrain, material), push)
        self._ground = terrain.polygons
        self._polygons = polygon_rows(self._ground)

    def reset(self) -> None:
        """Build a space with the robot at rest, and read its bodies."""
        self.world = self._new_world()
        read_bodies(self.world)

    def step(self, actuation: np.ndarray, step: int) -> bool:
        """Apply `actuation`, (n_voxels,), for control step `step`."""
        move(self.world, actuation)
        return True

    def _new_world(self) -> World:
        n, m = self._n_voxels, self._material
        space = Space(self._body, self._ground, m, self._solver)
        reader = munk.BodyReader(len(space.bodies))
        self.space, self._reader = space, reader  # keeps the objects of the handles alive
        return World(
            space=space.handle,
            bodies=space.bodies,
            springs=space.springs,
            rest=self._body.rest_lengths.copy(),
            actuation=np.zeros(n),
            dt=1.0 / CONTROL_RATE / self._solver.substeps,
            substeps=self._solver.substeps,
            current_poses=self._solver.rules.current_poses,
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
        )
