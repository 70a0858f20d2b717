"""The batched engine: robots of one shape on one terrain, stepped side by side in lanes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from sim_node.batched.contacts import find_contacts
from sim_node.batched.lane_faults import BodyFaultsInLanes
from sim_node.batched.outlines import observe, observe_and_sense
from sim_node.batched.state import Group, make_group, put_down
from sim_node.batched.step import physics_step
from sim_node.engine import Engine, check_engine
from sim_node.errors import InvalidInput
from sim_node.model.body import build_body, pushed
from sim_node.model.body_faults import Disturbance, FaultsOfBody, break_values, disturb_readings
from sim_node.model.material import Material
from sim_node.model.morphology import Morphology
from sim_node.model.sensing import Sensing, make_sensing
from sim_node.model.sensors import DEFAULT_SENSORS
from sim_node.model.solver import Solver
from sim_node.model.terrain import Terrain
from sim_node.numerics.jit import compiled, compiled_part

WIDTH = 16
"""Default number of robots in a group: two 512-bit registers of doubles, to hide latency."""


@compiled_part
def _move(group, step):
    """Apply `group.actuation` to all robots for control step `step`; step 0 is the start."""
    for i in range(group.actuation_lanes.shape[0]):
        for lane in range(group.actuation_lanes.shape[2]):
            a = group.actuation_lanes[i, 0, lane]
            group.actuation_lanes[i, 0, lane] = min(max(a, -1.0), 1.0)
    for _ in range(group.substeps if step > 0 else 0):
        physics_step(group)
    if step == 0 and group.current_poses:
        find_contacts(group)


@compiled
def move_group(group, step):
    """Advance all robots to the end of control step `step` and observe their voxels."""
    _move(group, step)
    observe(group)


@compiled
def advance_group(group, sensing, step):
    """Advance all robots to the end of control step `step` and read their sensors."""
    _move(group, step)
    observe_and_sense(group, sensing, step)


class OneRobot(NamedTuple):
    """The state of one robot as arrays without lanes, which share the memory of its group."""

    masses: np.ndarray  # (n_masses, 5) x, y, angle, v_x, v_y
    corners: np.ndarray  # (n_voxels, 4, 2) outer corners [m]
    area_ratios: np.ndarray  # (n_voxels,)
    touching: np.ndarray  # (n_voxels,) 0.0 or 1.0
    actuation: np.ndarray  # (n_voxels,) in [-1, 1]


def one_robot(group: Group) -> OneRobot:
    """Return the state of the robot in the first lane of a group."""
    return OneRobot(
        masses=group.mass_lanes[:, :5, 0],
        corners=group.corners['lane'][:, :, 0].reshape(-1, 4, 2),
        area_ratios=group.area_ratios['lane'][:, 0, 0],
        touching=group.touching['lane'][:, 0, 0],
        actuation=group.actuation_lanes[:, 0, 0],
    )


class Robots:
    """W robots of one shape, which differ in their actuation, and may in start and faults.

    The state of a robot depends only on its own actuation, start and faults, to the bit: not on W,
    its lane or the other robots.

    Args:
        morphology: morphology of the robots.
        terrain: the ground; robots do not collide with each other.
        material: physical constants.
        solver: sub-steps and iterations.
        width: number of robots W.
        push: default of `reset`: 0, or the seed of a pushed start of all robots.
        sensors: names of the sensors of each voxel, of `sim_node.model.sensors.SENSORS`.

    Attributes:
        group: state of the robots, which compiled code steps.
        sensing: sensors of the robots, which compiled code reads.
        step_count: number of control steps since the reset.
        material: physical constants.
        feet_of_walls: x [m] of the feet of the walls of the ground, (2,).

    Raises:
        InvalidInput: a sensor is unknown, or the solver has self-collision, which this engine
            does not support.
    """

    def __init__(
        self,
        morphology: Morphology,
        terrain: Terrain,
        material: Material,
        solver: Solver,
        width: int = WIDTH,
        push: int = 0,
        sensors: Sequence[str] = DEFAULT_SENSORS,
    ) -> None:
        check_engine('batched', solver)
        self._body, self._push = build_body(morphology, terrain, material), push
        self._morphology, self._width, self._n_sensors = morphology, width, len(sensors)
        self.feet_of_walls, self.material = terrain.feet_of_walls, material
        group = make_group(self._body, terrain.polygons, material, solver, width)
        self.group: Group = group
        self.sensing: Sensing = make_sensing(
            sensors, group.masses, group.area_ratios, group.touching
        )
        self.reset()

    def reset(
        self,
        pushes: int | Sequence[int] | None = None,
        faults: Sequence[FaultsOfBody] = (),
    ) -> None:
        """Place all robots at rest.

        Args:
            pushes: start of each robot, or of all: 0, or the seed of a pushed start, see
                `sim_node.model.body.pushed`; None for the `push` of the constructor.
            faults: faults of the body of each robot. If there are less than W pushes or faults, the
                last robots have exact starts, or no faults.

        Raises:
            InvalidInput: there are more than W pushes or faults, or a voxel that is named in a
                fault does not exist.
        """
        if pushes is None or isinstance(pushes, int):
            pushes = [self._push if pushes is None else pushes] * self._width
        for field, given in (('pushes', pushes), ('faults', faults)):
            if len(given) > self._width:
                raise InvalidInput(field, len(given), f'those of up to {self._width} robots')
        starts = [pushed(self._body, push).positions for push in pushes]
        starts += [self._body.positions] * (self._width - len(starts))
        put_down(self.group, np.stack(starts, axis=-1))
        of_all = [*faults, *[FaultsOfBody()] * (self._width - len(faults))]
        if not any(own.affect_body for own in faults):
            of_all = of_all[:1]  # a table without voxels needs no lanes
        self._faults = BodyFaultsInLanes(self._morphology, of_all, self._n_sensors)
        self.step_count = 0
        advance_group(self.group, self.sensing, 0)
        lanes = self.sensing.reading_lanes
        disturb_readings(lanes, lanes, self._faults.draw(-1, 1), 0)

    def disturbance(self, n_steps: int) -> Disturbance:
        """Return the faults of the bodies in the next `n_steps` control steps.

        Its tables are those of `BodyFaultsInLanes.draw`. The noise continues from the last call.
        """
        return self._faults.draw(self.step_count, n_steps)

    def step(self, actuation: np.ndarray) -> np.ndarray:
        """Apply `actuation`, (n_voxels, W) in [-1, 1], for 1/60 s; return the new readings.

        The readings of robots that are no longer `sane` are meaningless.
        """
        lanes, readings = self.group.actuation_lanes, self.sensing.reading_lanes
        acted, before, disturbance = lanes.copy(), readings.copy(), self.disturbance(1)
        lanes[:, 0] = actuation
        break_values(lanes, disturbance.actuators[0], acted)
        advance_group(self.group, self.sensing, self.step_count + 1)
        disturb_readings(readings, before, disturbance, 0)
        self.step_count += 1
        return self.readings

    @property
    def readings(self) -> np.ndarray:
        """Return the sensor readings, (n_voxels, n_sensors, W) in [0, 1]."""
        return self.sensing.reading_lanes.copy()

    @property
    def sane(self) -> np.ndarray:
        """Return for which robots the physics has not diverged, (W,) bool."""
        return self.sensing.sane_lanes[0, 0] > 0.0


class BatchedEngine(Engine):
    """The batched engine for one robot, a group with one lane.

    Attributes:
        group: state of the robot.
    """

    lanes = (4, 8, 16)  # each width is compiled when it is first used
    world: OneRobot

    def __init__(
        self,
        morphology: Morphology,
        terrain: Terrain,
        material: Material,
        solver: Solver,
        push: int = 0,
    ) -> None:
        self._body = pushed(build_body(morphology, terrain, material), push)
        self.group: Group = make_group(self._body, terrain.polygons, material, solver, 1)
        self.world = one_robot(self.group)

    def reset(self) -> None:
        """Place the robot at rest."""
        put_down(self.group, self._body.positions[..., np.newaxis])
        move_group(self.group, 0)

    def step(self, actuation: np.ndarray, step: int) -> bool:
        """Apply `actuation`, (n_voxels,), for control step `step`."""
        self.group.actuation_lanes[:, 0, 0] = actuation
        move_group(self.group, step)
        return True
