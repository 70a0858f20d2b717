"""Morphology and material become pymunk bodies, springs and joints.

The order in which bodies and constraints enter the space decides Munk2D's result and is part of
the model: per voxel its 4 masses; then per voxel its 18 springs, its 4 contraction limits and its
welds to neighbours with a smaller index.
"""

import functools
import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pymunk

from sim_node.material import Material
from sim_node.morphology import Morphology
from sim_node.terrain import Terrain

CORNERS = ((-1, 1), (1, 1), (1, -1), (-1, -1))
"""Signs of (x, y) of a voxel's four corner masses: NW, NE, SE, SW."""

GROUND_THICKNESS = 50.0
"""Depth [m] of the solid ground below its lowest point."""

_WALKER, _GROUND = 0b01, 0b10
_SIDES = ((0, 1), (1, 2), (2, 3), (3, 0))


@dataclass(frozen=True)
class Body:
    """A robot put down in a space of its own.

    Attributes:
        space: the pymunk space; holds ground and robot.
        masses: 4 bodies per voxel in the order of `CORNERS`, voxel by voxel.
        springs: 18 damped springs per voxel, voxel by voxel.
        rest: (3, n_springs) rest lengths [m] at full contraction, at rest and at full expansion.
        ground: the static body of the ground.
    """

    space: pymunk.Space
    masses: list[pymunk.Body]
    springs: list[pymunk.DampedSpring]
    rest: np.ndarray
    ground: pymunk.Body


def build_body(
    morphology: Morphology,
    terrain: Terrain,
    material: Material,
    iterations: int,
    self_collision: bool,
) -> Body:
    """Build a space with the ground and one robot, placed as in 2D-VSR-Sim.

    The robot's left-most point is 1 m past the left wall, its lowest point 1 m above the ground.
    """
    space = pymunk.Space()
    space.iterations = iterations
    space.gravity = (0.0, -material.gravity)
    space.damping = math.exp(-material.damping)
    ground = _add_ground(space, terrain)
    masses = _add_masses(space, morphology, terrain, material, self_collision)
    springs: list[pymunk.DampedSpring] = []
    for i in range(morphology.n_voxels):
        corners = masses[4 * i : 4 * i + 4]
        own = _springs(corners, material)
        springs += own
        space.add(*own)
        space.add(*_contraction_limits(corners, material))
        space.add(*_welds(i, morphology, masses, material))
    return Body(space, masses, springs, _rest_table(material, morphology.n_voxels), ground)


def placement(morphology: Morphology, terrain: Terrain, material: Material) -> tuple[float, float]:
    """Return the world's (x, y) [m] of the lower left corner of the morphology's grid."""
    x0, side = terrain.start + 1.0, material.side
    room = (
        y * side - terrain.highest(x0 + x * side, x0 + (x + 1) * side)
        for x, y in morphology.cells
    )
    return x0, 1.0 - min(room)


def _add_ground(space: pymunk.Space, terrain: Terrain) -> pymunk.Body:
    ground = space.static_body
    base = float(terrain.y.min()) - GROUND_THICKNESS
    points = list(zip(terrain.x.tolist(), terrain.y.tolist(), strict=True))
    for (x0, y0), (x1, y1) in zip(points[:-1], points[1:], strict=True):
        shape = pymunk.Poly(ground, [(x0, base), (x1, base), (x1, y1), (x0, y0)])
        # Munk2D multiplies the coefficients of a pair: the product is the masses' own.
        shape.friction = 1.0
        shape.elasticity = 1.0
        shape.filter = pymunk.ShapeFilter(categories=_GROUND)
        space.add(shape)
    return ground


def _add_masses(
    space: pymunk.Space,
    morphology: Morphology,
    terrain: Terrain,
    material: Material,
    self_collision: bool,
) -> list[pymunk.Body]:
    x0, y0 = placement(morphology, terrain, material)
    half, reach = material.side / 2, (material.side - material.mass_side) / 2
    mask = _GROUND | _WALKER if self_collision else _GROUND
    masses = []
    for x, y in morphology.cells:
        for sx, sy in CORNERS:
            body = pymunk.Body(material.mass, material.moment)
            body.position = (
                x0 + x * material.side + half + sx * reach,
                y0 + y * material.side + half + sy * reach,
            )
            shape = pymunk.Poly.create_box(body, (material.mass_side, material.mass_side))
            shape.friction = material.friction
            shape.elasticity = material.restitution
            shape.filter = pymunk.ShapeFilter(categories=_WALKER, mask=mask)
            space.add(body, shape)
            masses.append(body)
    return masses


def _spring_ends() -> list[tuple[int, int, tuple[float, float], tuple[float, float], int]]:
    """List the 18 springs: (mass a, mass b, anchor on a, anchor on b, kind of rest length).

    Anchors are in half sides of a mass; kinds index `Material.rest_lengths`.
    """
    ends = []
    for a, b in _SIDES:
        (ax, ay), (bx, by) = CORNERS[a], CORNERS[b]
        along = ((bx - ax) / 2, (by - ay) / 2)  # unit vector from mass a to mass b
        outward = ((ax + bx) / 2, (ay + by) / 2)  # unit vector out of the voxel

        def edge(sign: int, out: int, u=along, v=outward) -> tuple[float, float]:
            return sign * u[0] + out * v[0], sign * u[1] + out * v[1]

        for out_a, out_b, kind in ((1, 1, 0), (-1, -1, 0), (1, -1, 1), (-1, 1, 1)):
            ends.append((a, b, edge(1, out_a), edge(-1, out_b), kind))
    ends.append((0, 2, (0.0, 0.0), (0.0, 0.0), 2))
    ends.append((1, 3, (0.0, 0.0), (0.0, 0.0), 2))
    return ends


_SPRING_ENDS = _spring_ends()


class _Spring(NamedTuple):
    """One of a voxel's springs: masses, anchors [m] on them, rest length, stiffness, damping."""

    a: int
    b: int
    anchor_a: tuple[float, float]
    anchor_b: tuple[float, float]
    rest_length: float
    stiffness: float
    damping: float


@functools.cache
def _springs_of(material: Material) -> tuple[_Spring, ...]:
    """Return the 18 springs of a voxel; stiffness and damping follow from frequency and ratio."""
    rest = material.rest_lengths(material.side)
    omega = 2.0 * math.pi * material.frequency
    half, reach = material.mass_side / 2, (material.side - material.mass_side) / 2
    springs = []
    for a, b, end_a, end_b, kind in _SPRING_ENDS:
        at_a, at_b = (end_a[0] * half, end_a[1] * half), (end_b[0] * half, end_b[1] * half)
        x = (CORNERS[b][0] - CORNERS[a][0]) * reach + at_b[0] - at_a[0]
        y = (CORNERS[b][1] - CORNERS[a][1]) * reach + at_b[1] - at_a[1]
        axis = (x / math.hypot(x, y), y / math.hypot(x, y))
        m_eff = _effective_mass(material, axis, at_a, at_b)
        springs.append(_Spring(
            a, b, at_a, at_b, rest[kind],
            stiffness=m_eff * omega**2,
            damping=2.0 * m_eff * material.damping_ratio * omega,
        ))
    return tuple(springs)


def _effective_mass(
    material: Material, axis: tuple[float, float], *anchors: tuple[float, float]
) -> float:
    """Return the mass [kg] that a spring along `axis` feels, at rest, at its two anchors."""
    inverse = 0.0
    for x, y in anchors:
        inverse += 1.0 / material.mass + (x * axis[1] - y * axis[0]) ** 2 / material.moment
    return 1.0 / inverse


def _springs(corners: list[pymunk.Body], material: Material) -> list[pymunk.DampedSpring]:
    return [
        pymunk.DampedSpring(corners[spring.a], corners[spring.b], *spring[2:])
        for spring in _springs_of(material)
    ]


def _contraction_limits(
    corners: list[pymunk.Body], material: Material
) -> list[pymunk.SlideJoint]:
    """Keep the masses along each side at least one mass side apart, centre to centre."""
    return [
        pymunk.SlideJoint(
            corners[a], corners[b], (0.0, 0.0), (0.0, 0.0), material.mass_side, math.inf
        )
        for a, b in _SIDES
    ]


def _welds(
    i: int, morphology: Morphology, masses: list[pymunk.Body], material: Material
) -> list[pymunk.PivotJoint]:
    """Fix the facing masses of voxel `i` and its left and lower neighbours edge to edge.

    Two pivots, at both ends of the edge that a pair shares, hold position and angle.
    """
    r = material.mass_side / 2
    joints = []
    for direction, pairs in ((1, ((0, 1), (3, 2))), (2, ((3, 0), (2, 1)))):
        j = morphology.neighbors[i, direction]
        if j < 0:
            continue
        for mine, theirs in pairs:
            for t in (r, -r):
                here, there = ((-r, t), (r, t)) if direction == 1 else ((t, -r), (t, r))
                joint = pymunk.PivotJoint(
                    masses[4 * i + mine], masses[4 * j + theirs], here, there
                )
                joint.collide_bodies = False
                joints.append(joint)
    return joints


def _rest_table(material: Material, n_voxels: int) -> np.ndarray:
    kinds = [kind for *_, kind in _SPRING_ENDS]
    changes = (-material.area_range, 0.0, material.area_range)
    rows = [material.rest_lengths(material.actuated_side(change)) for change in changes]
    return np.tile(np.array([[row[kind] for kind in kinds] for row in rows]), (1, n_voxels))
