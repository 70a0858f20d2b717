"""The state of a group: W robots of one shape on one terrain, one in each lane.

All masses of a robot are equal. So impulses are stored per mass [m/s], and angular velocities are
multiplied by the radius of gyration, sqrt(moment / mass) [m/s]. A unit impulse then changes a
linear or an angular velocity by one, and neither mass nor moment appears in the solver.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.model.body import LIMIT, SPRING, WELD, Body
from sim_node.model.ground_polygons import most_at_once, polygon_rows
from sim_node.model.material import Material
from sim_node.model.solver import Solver
from sim_node.numerics.lane_array import zeros

JOINT_ERROR = float(np.float32(1.0) - np.float32(0.1)) ** 60
"""Share of an overlap or of a joint's gap that remains in Munk2D after a second."""

BOX_GROWTH = float(np.float32(0.1))
"""Margin by which Munk2D enlarges a box of the broad phase on each side: this share of its size,
and the motion in so many seconds."""

N_SPRINGS, N_LIMITS = 18, 4
"""Springs and contraction limits of a voxel."""

# Fields of the arrays of lanes.
X, Y, ANGLE, VX, VY, SPIN, BIAS_X, BIAS_Y, BIAS_SPIN, COS, SIN = range(11)
POLYGON, STAMP, RANK, TURN, WARM, NX, NY = range(7)
N_CONTACT_FIELDS = 7 + 2 * 10  # these, and those of two points: see `contacts`


class Group(NamedTuple):
    """The data that a step reads and writes; items of lane arrays, (rows, fields), have W lanes."""

    substeps: int
    iterations: int
    implicit_springs: bool  # see `sim_node.model.physics`
    current_poses: bool
    slop: float  # depth [m] up to which contacts do not correct an overlap
    dt: float  # physics step [s]
    damping: float  # factor on all velocities per step
    fall: float  # change of velocity by gravity per step [m/s]
    bias: float  # velocity that corrects an overlap or gap, per length of it [1/s]
    half: float  # half the side of a mass [m]
    inv_gyration_radius: float  # 1 over the radius of gyration of a mass [1/m]
    friction: float
    restitution: float
    rest_area: float  # of a voxel [m^2]

    spring_ends: np.ndarray  # (n_springs, 2) masses
    spring_table: np.ndarray  # (n_springs, 10) see `_spring_rows`
    limit_ends: np.ndarray  # (n_limits, 2) masses
    limits_table: np.ndarray  # (n_limits,) least distance [m]
    weld_ends: np.ndarray  # (n_welds, 2) masses, the same for welds 2 k and 2 k + 1
    weld_anchors: np.ndarray  # (n_welds, 4) [m]
    polygons: np.ndarray  # (n_polygons, 8) see `polygon_rows`
    left_sides: np.ndarray  # (n_polygons,) x [m], increasing
    slots: int  # contacts of a mass: with polygon p in slot p % slots

    step_count: np.ndarray  # (1,) physics steps
    actuation: np.ndarray  # lanes (n_voxels, 1) in [-1, 1]
    masses: np.ndarray  # lanes (n_masses, 11)
    springs: np.ndarray  # lanes (n_springs, 8), see `springs`
    limits: np.ndarray  # lanes (n_limits, 4), see `joints`
    active: np.ndarray  # (n_limits + n_voxels,) limits, and voxels with limits, active in a lane
    welds: np.ndarray  # lanes (n_welds, 11)
    boxes: np.ndarray  # lanes (n_masses, 4) left, bottom, right, top of Munk2D's broad phase [m]
    contacts: np.ndarray  # lanes (n_masses * slots, ...), see `contacts`
    in_use: np.ndarray  # (n_masses * slots,) rows of `contacts` that some lane touches now
    schedule: np.ndarray  # (n_masses * slots**2, 2) rows of `contacts` and the turn of each
    scheduled: np.ndarray  # (1,) number of rows of the schedule in use
    deep: np.ndarray  # (1,) whether some lane has an overlap to correct

    corners: np.ndarray  # lanes (n_voxels * 4, 2) outer corners [m]
    area_ratios: np.ndarray  # lanes (n_voxels, 1)
    touching: np.ndarray  # lanes (n_voxels, 1) 0.0 or 1.0

    mass_lanes: np.ndarray  # (n_masses, 11, W) `masses` as numbers, in the same memory
    actuation_lanes: np.ndarray  # (n_voxels, 1, W) `actuation` as numbers


def make_group(
    body: Body, ground: np.ndarray, material: Material, solver: Solver, width: int
) -> Group:
    """Return the state of `width` robots; `put_down` then places them.

    Args:
        body: masses and constraints of the robot.
        ground: (n_polygons, 4, 2) corners [m], see `Terrain.polygons`.
        material: physical constants.
        solver: sub-steps and iterations.
        width: number of lanes W.
    """
    table = body.constraints
    dt = 1.0 / CONTROL_RATE / solver.substeps
    springs, limits, welds = (np.flatnonzero(table.kinds == k) for k in (SPRING, LIMIT, WELD))
    n_masses, n_voxels = len(body.positions), len(springs) // N_SPRINGS
    diagonal = material.mass_side * math.sqrt(2.0)
    slots = min(most_at_once(ground, diagonal) + 1, len(ground))
    actuation, masses = zeros((n_voxels, 1), width), zeros((n_masses, 11), width)
    return Group(
        substeps=solver.substeps,
        iterations=solver.iterations,
        implicit_springs=solver.rules.implicit_springs,
        current_poses=solver.rules.current_poses,
        slop=solver.rules.slop,
        dt=dt,
        damping=math.exp(-material.damping) ** dt,
        fall=material.gravity * dt,
        bias=(1.0 - JOINT_ERROR**dt) / dt,
        half=material.mass_side / 2.0,
        inv_gyration_radius=math.sqrt(material.mass / material.moment),
        friction=material.friction,
        restitution=material.restitution,
        rest_area=material.side**2,
        spring_ends=table.ends[springs].astype(np.int64),
        spring_table=_spring_rows(body, springs, dt, material.mass),
        limit_ends=table.ends[limits].astype(np.int64),
        limits_table=table.rest[limits],
        weld_ends=table.ends[welds].astype(np.int64),
        weld_anchors=table.anchors[welds],
        polygons=polygon_rows(ground),
        left_sides=np.ascontiguousarray(ground[:, 0, 0]),
        slots=slots,
        step_count=np.zeros(1),
        actuation=actuation,
        masses=masses,
        springs=zeros((len(springs), 8), width),
        limits=zeros((len(limits), 4), width),
        active=np.zeros(len(limits) + n_voxels, dtype=np.bool_),
        welds=zeros((len(welds), 11), width),
        boxes=zeros((n_masses, 4), width),
        contacts=zeros((n_masses * slots, N_CONTACT_FIELDS), width),
        in_use=np.zeros(n_masses * slots, dtype=np.bool_),
        schedule=np.zeros((n_masses * slots**2, 2), dtype=np.int64),
        scheduled=np.zeros(1, dtype=np.int64),
        deep=np.zeros(1, dtype=np.bool_),
        corners=zeros((n_voxels * 4, 2), width),
        area_ratios=zeros((n_voxels, 1), width),
        touching=zeros((n_voxels, 1), width),
        mass_lanes=masses['lane'],
        actuation_lanes=actuation['lane'],
    )


def put_down(group: Group, positions: np.ndarray) -> None:
    """Place all robots of the group at rest, in the initial state.

    Args:
        group: the group.
        positions: (n_masses, 2, W) of the masses of each robot, or (n_masses, 2, 1) of all [m].
    """
    for array in group:
        if isinstance(array, np.ndarray) and array.dtype.fields:
            array['lane'] = 0.0
    group.step_count[0] = 0.0
    group.in_use[:] = False
    group.scheduled[0] = 0
    group.mass_lanes[:, :2] = positions
    group.mass_lanes[:, COS] = 1.0
    group.contacts['lane'][:, POLYGON] = -1.0
    # Munk2D enlarges the box of a mass that does not move by a tenth of its size on each side.
    x, y = group.mass_lanes[:, X], group.mass_lanes[:, Y]
    reach = group.half * (1.0 + 2.0 * BOX_GROWTH)
    sides = x - reach, y - reach, x + reach, y + reach
    group.boxes['lane'][:] = np.stack(sides, axis=1)


def _spring_rows(body: Body, springs: np.ndarray, dt: float, mass: float) -> np.ndarray:
    """Return the table of n springs, (n, 10).

    Its columns are: four of anchors [m]; the rest lengths [m] at full contraction, at rest and at
    full expansion; stiffness and damping, each times dt over mass; the softness of an implicit
    spring, gamma times the mass, see `springs`.
    """
    table = body.constraints
    pull, drag = table.stiffness[springs] * dt / mass, table.damping[springs] * dt / mass
    softness = 1.0 / (drag + dt * pull)
    return np.column_stack([table.anchors[springs], body.rest_lengths.T, pull, drag, softness])
