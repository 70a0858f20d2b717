"""Morphology and material become tables of masses and constraints, for every engine the same.

The order in which masses and constraints enter a space decides an engine's result and is part of
the model: per voxel its 4 masses; then per voxel its 18 springs, its 4 contraction limits and its
welds to neighbours with a smaller index.
"""

import math
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from sim_node.model.material import Material
from sim_node.model.morphology import Morphology
from sim_node.model.terrain import Terrain

CORNERS = ((-1, 1), (1, 1), (1, -1), (-1, -1))
"""Signs of (x, y) of a voxel's four corner masses: NW, NE, SE, SW."""

SPRING, LIMIT, WELD = range(3)
"""Kinds of constraint: a damped spring; a least distance; a pivot, two anchors held together."""

PUSH = 1e-6
"""How far a pushed start moves a mass in x and in y at most [m]."""

_SIDES = ((0, 1), (1, 2), (2, 3), (3, 0))


class Constraints(NamedTuple):
    """What acts between two masses: one row per constraint, in the order of insertion.

    Attributes:
        kinds: (n,) `SPRING`, `LIMIT` or `WELD`.
        ends: (n, 2) indices of the masses a and b.
        anchors: (n, 4) a's x, y and b's x, y [m], each in its mass's own axes.
        rest: (n,) a spring's length at rest, a limit's least distance [m]; 0 for a weld.
        stiffness: (n,) of a spring [N/m]; 0 for others.
        damping: (n,) of a spring [N s/m]; 0 for others.
    """

    kinds: np.ndarray
    ends: np.ndarray
    anchors: np.ndarray
    rest: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray


@dataclass(frozen=True, eq=False)
class Body:
    """A robot put down at rest: square masses, all alike (`Material`), and what joins them.

    Masses that a weld joins do not collide.

    Attributes:
        positions: (n_masses, 2) of the masses [m], in the order of `CORNERS`, voxel by voxel.
        constraints: 18 springs, 4 contraction limits and the welds of each voxel in turn.
        rest_lengths: (3, n_springs) [m] at full contraction, at rest and at full expansion, 18 per
            voxel in the order of the springs among the constraints.
    """

    positions: np.ndarray
    constraints: Constraints
    rest_lengths: np.ndarray


def build_body(morphology: Morphology, terrain: Terrain, material: Material) -> Body:
    """Return the robot's tables, placed as in 2D-VSR-Sim.

    The robot's left-most point is 1 m past the left wall, its lowest point 1 m above the ground.
    """
    return Body(
        _positions(morphology, terrain, material),
        _constraints(morphology, material),
        _rest_lengths(morphology, material),
    )


def pushed(body: Body, seed: int) -> Body:
    """Return the robot with every mass moved by up to `PUSH` in x and in y; seed 0 moves none."""
    if seed == 0:
        return body
    displacement = np.random.default_rng(seed).uniform(-PUSH, PUSH, body.positions.shape)
    return replace(body, positions=body.positions + displacement)


def placement(morphology: Morphology, terrain: Terrain, material: Material) -> tuple[float, float]:
    """Return the world's (x, y) [m] of the lower left corner of the morphology's grid."""
    x0, side = terrain.start + 1.0, material.side
    room = (
        y * side - terrain.highest(x0 + x * side, x0 + (x + 1) * side)
        for x, y in morphology.cells
    )
    return x0, 1.0 - min(room)


def _positions(morphology: Morphology, terrain: Terrain, material: Material) -> np.ndarray:
    x0, y0 = placement(morphology, terrain, material)
    half, reach = material.side / 2, (material.side - material.mass_side) / 2
    return np.array([
        (x0 + x * material.side + half + sx * reach, y0 + y * material.side + half + sy * reach)
        for x, y in morphology.cells
        for sx, sy in CORNERS
    ])


class _Row(NamedTuple):
    """One constraint; anchors [m] on the masses a and b."""

    kind: int
    a: int
    b: int
    anchor_a: tuple[float, float] = (0.0, 0.0)
    anchor_b: tuple[float, float] = (0.0, 0.0)
    rest: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0


def _constraints(morphology: Morphology, material: Material) -> Constraints:
    own = [*_springs(material), *_contraction_limits(material)]
    rows = []
    for i in range(morphology.n_voxels):
        rows += [row._replace(a=4 * i + row.a, b=4 * i + row.b) for row in own]
        rows += _welds(i, morphology, material)
    kinds, a, b, anchors_a, anchors_b, *numbers = zip(*rows, strict=True)
    return Constraints(
        np.array(kinds),
        np.column_stack([a, b]),
        np.column_stack([anchors_a, anchors_b]),
        *map(np.array, numbers),
    )


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


def _springs(material: Material) -> list[_Row]:
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
        springs.append(_Row(
            SPRING, a, b, at_a, at_b, rest[kind],
            stiffness=m_eff * omega**2,
            damping=2.0 * m_eff * material.damping_ratio * omega,
        ))
    return springs


def _effective_mass(
    material: Material, axis: tuple[float, float], *anchors: tuple[float, float]
) -> float:
    """Return the mass [kg] that a spring along `axis` feels, at rest, at its two anchors."""
    inverse = 0.0
    for x, y in anchors:
        inverse += 1.0 / material.mass + (x * axis[1] - y * axis[0]) ** 2 / material.moment
    return 1.0 / inverse


def _contraction_limits(material: Material) -> list[_Row]:
    """Keep the masses along each side at least one mass side apart, centre to centre."""
    return [_Row(LIMIT, a, b, rest=material.mass_side) for a, b in _SIDES]


def _welds(i: int, morphology: Morphology, material: Material) -> list[_Row]:
    """Fix the facing masses of voxel `i` and its left and lower neighbours edge to edge.

    Two pivots, at both ends of the edge that a pair shares, hold position and angle.
    """
    r = material.mass_side / 2
    welds = []
    for direction, pairs in ((1, ((0, 1), (3, 2))), (2, ((3, 0), (2, 1)))):
        j = morphology.neighbors[i, direction]
        if j < 0:
            continue
        for mine, theirs in pairs:
            for t in (r, -r):
                here, there = ((-r, t), (r, t)) if direction == 1 else ((t, -r), (t, r))
                welds.append(_Row(WELD, 4 * i + mine, 4 * j + theirs, here, there))
    return welds


def _rest_lengths(morphology: Morphology, material: Material) -> np.ndarray:
    kinds = [kind for *_, kind in _SPRING_ENDS]
    changes = (-material.area_range, 0.0, material.area_range)
    rows = [material.rest_lengths(material.actuated_side(change)) for change in changes]
    return np.tile(np.array([[row[kind] for kind in kinds] for row in rows]), morphology.n_voxels)
