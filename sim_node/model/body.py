"""Tables of a robot's masses and constraints, built from morphology and material for all engines.

The order in which masses and constraints are added to an engine affects its result, so it is part
of the model: first the 4 masses of each voxel; then, voxel by voxel, its 18 springs, its 4
contraction limits and its welds to neighbours with a smaller index.
"""

import functools
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
"""Kinds of constraint: damped spring; minimum distance; pivot, which keeps two anchors together."""

PUSH = 1e-6
"""Largest displacement of a mass in x and in y by a pushed start [m]."""

_SIDES = ((0, 1), (1, 2), (2, 3), (3, 0))


class Constraints(NamedTuple):
    """The constraints between pairs of masses, one row each, in the order of insertion.

    Attributes:
        kinds: (n,) `SPRING`, `LIMIT` or `WELD`.
        ends: (n, 2) indices of the masses a and b.
        anchors: (n, 4) x, y on a and x, y on b [m], from the centre and in the axes of the mass.
        rest: (n,) rest length of a spring, minimum distance of a limit [m]; 0 for a weld.
        stiffness: (n,) stiffness of a spring [N/m]; 0 for others.
        damping: (n,) damping of a spring [N s/m]; 0 for others.
    """

    kinds: np.ndarray
    ends: np.ndarray
    anchors: np.ndarray
    rest: np.ndarray
    stiffness: np.ndarray
    damping: np.ndarray


@dataclass(frozen=True, eq=False)
class Body:
    """A robot at rest at its start: equal square masses (`Material`) and their constraints.

    Masses that a weld joins do not collide.

    Attributes:
        positions: (n_masses, 2) centres of the masses [m], per voxel in the order of `CORNERS`.
        constraints: 18 springs, 4 contraction limits and the welds of each voxel in turn.
        rest_lengths: (3, n_springs) rest lengths [m] at full contraction, at rest and at full
            expansion, in the order of the springs among the constraints.
    """

    positions: np.ndarray
    constraints: Constraints
    rest_lengths: np.ndarray


class Springs(NamedTuple):
    """The springs of a robot, one row each, in their order among the constraints.

    Attributes:
        ends, anchors, stiffness: as of `Constraints`.
        rest_lengths: (n_springs, 3) columns as the rows of `Body.rest_lengths`.
    """

    ends: np.ndarray
    anchors: np.ndarray
    stiffness: np.ndarray
    rest_lengths: np.ndarray


@functools.lru_cache(maxsize=16)
def springs_of(morphology: Morphology, material: Material) -> Springs:
    """Return the springs of a robot, the same number for each voxel in turn; do not modify them."""
    table = _constraints(morphology, material)
    rows = np.flatnonzero(table.kinds == SPRING)
    return Springs(
        table.ends[rows].astype(np.int64), table.anchors[rows], table.stiffness[rows],
        np.ascontiguousarray(_rest_lengths(morphology, material).T),
    )


def build_body(morphology: Morphology, terrain: Terrain, material: Material) -> Body:
    """Return the tables of a robot, placed as in 2D-VSR-Sim.

    The robot's left-most point is 1 m right of the left wall, its smallest clearance above
    the ground 1 m.
    """
    return Body(
        _positions(morphology, terrain, material),
        _constraints(morphology, material),
        _rest_lengths(morphology, material),
    )


def pushed(body: Body, seed: int) -> Body:
    """Return the body with every mass displaced at random by up to `PUSH` in x and in y.

    Args:
        body: the robot.
        seed: of the displacements; 0 for none.
    """
    if seed == 0:
        return body
    displacement = np.random.default_rng(seed).uniform(-PUSH, PUSH, body.positions.shape)
    return replace(body, positions=body.positions + displacement)


def placement(morphology: Morphology, terrain: Terrain, material: Material) -> tuple[float, float]:
    """Return (x, y) [m], in the world, of the lower left corner of the morphology's grid."""
    x0, side = terrain.start + 1.0, material.side
    clearances = (
        y * side - terrain.highest(x0 + x * side, x0 + (x + 1) * side)
        for x, y in morphology.squares
    )
    return x0, 1.0 - min(clearances)


def _positions(morphology: Morphology, terrain: Terrain, material: Material) -> np.ndarray:
    """Return the (n_masses, 2) centres [m] of the masses."""
    x0, y0 = placement(morphology, terrain, material)
    half, reach = material.side / 2, (material.side - material.mass_side) / 2
    return np.array([
        (x0 + x * material.side + half + sx * reach, y0 + y * material.side + half + sy * reach)
        for x, y in morphology.squares
        for sx, sy in CORNERS
    ])


class _Row(NamedTuple):
    """One row of `Constraints`; a and b are indices of masses."""

    kind: int
    a: int
    b: int
    anchor_a: tuple[float, float] = (0.0, 0.0)
    anchor_b: tuple[float, float] = (0.0, 0.0)
    rest: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0


def _constraints(morphology: Morphology, material: Material) -> Constraints:
    """Return all constraints of a robot, in the order of insertion."""
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
    """Return the 18 springs of a voxel: mass a, mass b, anchor on a, anchor on b, kind.

    Anchors are in units of half the side of a mass; kinds index `Material.rest_lengths`.
    """
    ends = []
    for a, b in _SIDES:
        (ax, ay), (bx, by) = CORNERS[a], CORNERS[b]
        along = ((bx - ax) / 2, (by - ay) / 2)  # unit vector from mass a to mass b
        outward = ((ax + bx) / 2, (ay + by) / 2)  # unit vector out of the voxel

        def corner(sign: int, out: int, u=along, v=outward) -> tuple[float, float]:
            return sign * u[0] + out * v[0], sign * u[1] + out * v[1]

        for out_a, out_b, kind in ((1, 1, 0), (-1, -1, 0), (1, -1, 1), (-1, 1, 1)):
            ends.append((a, b, corner(1, out_a), corner(-1, out_b), kind))
    ends.append((0, 2, (0.0, 0.0), (0.0, 0.0), 2))
    ends.append((1, 3, (0.0, 0.0), (0.0, 0.0), 2))
    return ends


_SPRING_ENDS = _spring_ends()


def _springs(material: Material) -> list[_Row]:
    """Return the 18 springs of a voxel, with the material's frequency and damping ratio."""
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
    """Return the effective mass [kg] of a spring along `axis` between two anchors [m] at rest."""
    inverse = 0.0
    for x, y in anchors:
        inverse += 1.0 / material.mass + (x * axis[1] - y * axis[0]) ** 2 / material.moment
    return 1.0 / inverse


def _contraction_limits(material: Material) -> list[_Row]:
    """Return the 4 limits of a voxel: along each side, centres at least one mass side apart."""
    return [_Row(LIMIT, a, b, rest=material.mass_side) for a, b in _SIDES]


def _welds(i: int, morphology: Morphology, material: Material) -> list[_Row]:
    """Return the welds of voxel `i` to its left and lower neighbours.

    Two masses that face each other are joined by two pivots at the ends of their common edge, which
    fix position and angle.
    """
    half = material.mass_side / 2
    welds = []
    for direction, pairs in ((1, ((0, 1), (3, 2))), (2, ((3, 0), (2, 1)))):
        j = morphology.neighbors[i, direction]
        if j < 0:
            continue
        for mine, theirs in pairs:
            for t in (half, -half):
                if direction == 1:
                    here, there = (-half, t), (half, t)
                else:
                    here, there = (t, -half), (t, half)
                welds.append(_Row(WELD, 4 * i + mine, 4 * j + theirs, here, there))
    return welds


def _rest_lengths(morphology: Morphology, material: Material) -> np.ndarray:
    """Return the (3, n_springs) rest lengths [m] of `Body`."""
    kinds = [kind for *_, kind in _SPRING_ENDS]
    changes = (-material.area_range, 0.0, material.area_range)
    rows = [material.rest_lengths(material.actuated_side(change)) for change in changes]
    return np.tile(np.array([[row[kind] for kind in kinds] for row in rows]), morphology.n_voxels)
