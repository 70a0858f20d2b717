"""A Munk2D space with ground and one robot, built from the robot's tables by compiled code.

Bodies and constraints are added in the order of the tables. Building a space of pymunk's Python
objects, about 300 per robot, takes more than ten times as long.
"""

import functools
import math
import weakref
from collections.abc import Callable

import numpy as np
from pymunk._chipmunk import lib

from sim_node.model.body import LIMIT, SPRING, WELD, Body
from sim_node.model.material import Material
from sim_node.model.solver import Solver
from sim_node.munk2d import c_functions as munk
from sim_node.munk2d import soft_spring
from sim_node.numerics.jit import compiled

_ROBOT, _GROUND = 0b01, 0b10
_EVERYTHING = 0xFFFFFFFF
_SELF_FRICTION, _SELF_RESTITUTION = 10.0, 0.1  # 2D-VSR-Sim, between masses of one robot


class Space:
    """A Munk2D space with ground and one robot; it is freed with this object.

    Handles are pointers of Munk2D as integers, valid until this object is freed. `pymunk_view`
    shows what they point to.

    Args:
        body: the robot.
        ground: (n_pieces, 4, 2) corners [m] of the ground's polygons, see `Terrain.polygons`.
        material: of masses, contacts and world.
        solver: iterations, self-collision and physics.

    Attributes:
        handle: of the space.
        ground: handle of the ground, a static body.
        bodies: (n_masses,) handles, in the order of the robot's masses.
        springs: (n_springs,) handles, in the order of the robot's springs.
    """

    def __init__(
        self, body: Body, ground: np.ndarray, material: Material, solver: Solver
    ) -> None:
        space = lib.cpSpaceNew()
        lib.cpSpaceSetIterations(space, solver.iterations)
        lib.cpSpaceSetGravity(space, (0.0, -material.gravity))
        lib.cpSpaceSetDamping(space, math.exp(-material.damping))
        lib.cpSpaceSetCollisionSlop(space, solver.rules.slop)
        self.handle = munk.handle(space)
        self.ground = munk.handle(lib.cpSpaceGetStaticBody(space))
        friction, restitution = material.friction, material.restitution
        ground_friction = ground_restitution = 1.0
        as_reference = solver.self_collision == 'reference'
        if as_reference:  # Munk2D multiplies the coefficients of two shapes
            friction, restitution = math.sqrt(_SELF_FRICTION), math.sqrt(_SELF_RESTITUTION)
            ground_friction = material.friction / friction
            ground_restitution = material.restitution / restitution
        ground_shapes = self._add_ground(ground, ground_friction, ground_restitution)
        self.bodies, shapes = _add_masses(
            self.handle,
            body.positions,
            material.mass,
            material.moment,
            material.mass_side,
            friction,
            restitution,
            _GROUND | _ROBOT if solver.self_collision else _GROUND,
            munk.STAY if solver.rules.current_poses else 0,
        )
        functions = soft_spring.ADDRESS if solver.rules.implicit_springs else 0
        constraints = _add_constraints(
            self.handle, self.bodies, body.constraints, functions, not as_reference
        )
        self.springs = constraints[body.constraints.kinds == SPRING]
        finalizer = weakref.finalize(
            self, _loaded_free(), self.handle, constraints, ground_shapes, shapes, self.bodies
        )
        finalizer.atexit = False  # all memory is freed when the process ends

    def _add_ground(
        self, polygons: np.ndarray, friction: float, restitution: float
    ) -> np.ndarray:
        """Add the ground's shapes and return their handles; this object frees them."""
        return _add_polygons(self.handle, self.ground, polygons, friction, restitution)


@compiled
def _add_shape(space, shape, friction, elasticity, category, mask):
    """Set a shape's coefficients and collision filter, and add it to the space.

    The coefficients of a pair are the products of those of its two shapes.
    """
    munk.shape_set_friction(shape, friction)
    munk.shape_set_elasticity(shape, elasticity)
    munk.shape_set_filter(shape, 0, np.uint64(category) | np.uint64(mask) << np.uint64(32))
    munk.space_add_shape(space, shape)


@compiled
def _add_polygons(space, ground, polygons, friction, elasticity):
    """Add the ground's polygons and return their handles."""
    shapes = np.empty(polygons.shape[0], np.uintp)
    for i in range(polygons.shape[0]):
        corners = polygons[i]
        shapes[i] = munk.polygon_new(ground, corners.shape[0], corners.ctypes.data, 0.0)
        _add_shape(space, shapes[i], friction, elasticity, _GROUND, _EVERYTHING)
    return shapes


@compiled
def _add_masses(space, positions, mass, moment, side, friction, elasticity, mask, move):
    """Add a square body at each position; return the handles of bodies and shapes.

    `move` is the address of their position update function; 0 selects Munk2D's own.
    """
    bodies = np.empty(positions.shape[0], np.uintp)
    shapes = np.empty(positions.shape[0], np.uintp)
    for i in range(positions.shape[0]):
        bodies[i] = munk.body_new(mass, moment)
        munk.body_set_position(bodies[i], positions[i, 0], positions[i, 1])
        munk.space_add_body(space, bodies[i])
        if move != 0:
            munk.body_set_position_function(bodies[i], np.uintp(move))
        shapes[i] = munk.box_new(bodies[i], side, side, 0.0)
        _add_shape(space, shapes[i], friction, elasticity, _ROBOT, mask)
    return bodies, shapes


@compiled
def _add_constraints(space, bodies, table, functions, joined_collide):
    """Add all constraints and return their handles.

    Args:
        functions: `soft_spring.ADDRESS` for soft springs, 0 for Munk2D's damped springs.
        joined_collide: whether masses that a spring or limit joins may collide; welded masses
            never do.
    """
    constraints = np.empty(table.kinds.shape[0], np.uintp)
    for i in range(constraints.shape[0]):
        a, b = bodies[table.ends[i, 0]], bodies[table.ends[i, 1]]
        ax, ay, bx, by = table.anchors[i]
        if table.kinds[i] == SPRING:
            constraints[i] = munk.spring_new(
                a, b, ax, ay, bx, by, table.rest[i], table.stiffness[i], table.damping[i]
            )
            if functions != 0:
                soft_spring.soften(constraints[i], np.uintp(functions))
        elif table.kinds[i] == LIMIT:
            constraints[i] = munk.limit_new(a, b, ax, ay, bx, by, table.rest[i], math.inf)
        else:
            constraints[i] = munk.pivot_new(a, b, ax, ay, bx, by)
        if table.kinds[i] == WELD or not joined_collide:
            munk.constraint_set_collide_bodies(constraints[i], 0)
        munk.space_add_constraint(space, constraints[i])
    return constraints


@compiled
def _free(space, constraints, ground_shapes, shapes, bodies):
    """Free a space, then its constraints, shapes and bodies."""
    munk.space_free(space)
    for i in range(constraints.shape[0]):
        munk.constraint_free(constraints[i])
    for i in range(ground_shapes.shape[0]):
        munk.shape_free(ground_shapes[i])
    for i in range(shapes.shape[0]):
        munk.shape_free(shapes[i])
    for i in range(bodies.shape[0]):
        munk.body_free(bodies[i])


@functools.cache
def _loaded_free() -> Callable:
    """Return `_free`, compiled now: the garbage collector may call it during a compilation."""
    nothing = np.empty(0, np.uintp)
    _free(0, nothing, nothing, nothing, nothing)
    return _free
