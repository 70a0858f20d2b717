"""A pymunk space with the ground and one robot, from the robot's tables."""

import math

import pymunk

from sim_node.body import LIMIT, SPRING, Body
from sim_node.material import Material
from sim_node.solver import Solver
from sim_node.terrain import Terrain

GROUND_THICKNESS = 50.0
"""Depth [m] of the solid ground below its lowest point."""

_WALKER, _GROUND = 0b01, 0b10


class Space:
    """A pymunk space that holds ground and robot.

    Attributes:
        space: the pymunk space.
        masses: bodies in the order of the table.
        springs: damped springs in the order of the table.
        ground: the static body of the ground.
    """

    def __init__(self, body: Body, terrain: Terrain, material: Material, solver: Solver) -> None:
        self.space = pymunk.Space()
        self.space.iterations = solver.iterations
        self.space.gravity = (0.0, -material.gravity)
        self.space.damping = math.exp(-material.damping)
        self.ground = _add_ground(self.space, terrain)
        self.masses = _add_masses(self.space, body, material, solver.self_collision)
        _add_constraints(self.space, body, self.masses)
        self.springs = [c for c in self.space.constraints if isinstance(c, pymunk.DampedSpring)]


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
    space: pymunk.Space, table: Body, material: Material, self_collision: bool
) -> list[pymunk.Body]:
    mask = _GROUND | _WALKER if self_collision else _GROUND
    masses = []
    for x, y in table.positions.tolist():
        body = pymunk.Body(material.mass, material.moment)
        body.position = (x, y)
        shape = pymunk.Poly.create_box(body, (material.mass_side, material.mass_side))
        shape.friction = material.friction
        shape.elasticity = material.restitution
        shape.filter = pymunk.ShapeFilter(categories=_WALKER, mask=mask)
        space.add(body, shape)
        masses.append(body)
    return masses


def _add_constraints(space: pymunk.Space, table: Body, masses: list[pymunk.Body]) -> None:
    for kind, (i, j), anchors, rest, k, c in zip(
        *(column.tolist() for column in table.constraints), strict=True
    ):
        a, b, at_a, at_b = masses[i], masses[j], tuple(anchors[:2]), tuple(anchors[2:])
        if kind == SPRING:
            space.add(pymunk.DampedSpring(a, b, at_a, at_b, rest, k, c))
        elif kind == LIMIT:
            space.add(pymunk.SlideJoint(a, b, at_a, at_b, rest, math.inf))
        else:
            weld = pymunk.PivotJoint(a, b, at_a, at_b)
            weld.collide_bodies = False
            space.add(weld)
