"""A robot's space as pymunk objects, for tests, measurements and interactive inspection."""

import weakref
from collections.abc import Callable
from typing import Any

import pymunk
from pymunk._chipmunk import ffi, lib

from sim_node.munk2d.c_functions import handle
from sim_node.munk2d.soft_spring import SPRING, is_soft, layout_of
from sim_node.munk2d.space import Space


def pymunk_view(space: Space) -> pymunk.Space:
    """Return a pymunk space with the bodies, shapes and constraints of a robot's space, in order.

    Attributes are read from and written to Munk2D; only adding and removing objects is not
    supported. The space is not freed before all objects of the view. Every shape is a
    `pymunk.Poly`, since `Space` makes only polygons; queries return the shapes of the latest view.
    In the reference physics a step of the view moves no body; `Simulation.step` moves them.
    """
    def hold(pointer: Any) -> Any:
        return ffi.gc(pointer, lambda _: space)  # keeps a reference to the space; frees nothing

    view = pymunk.Space()
    view._space = hold(ffi.cast('cpSpace *', space.handle))
    ground = view._static_body = pymunk.Body(body_type=pymunk.Body.STATIC)
    ground._body = hold(ffi.cast('cpBody *', space.ground))
    bodies = {space.ground: ground}
    for pointer in _each(view, lib.cpSpaceEachBody, lib.ext_cpSpaceBodyIteratorFunc):
        body = bodies[handle(pointer)] = pymunk.Body()
        body._body = hold(pointer)
        view._bodies[body] = None
    for body in bodies.values():
        body._space = weakref.ref(view)
    shapes = _each(view, lib.cpSpaceEachShape, lib.ext_cpSpaceShapeIteratorFunc)
    for pointer in sorted(shapes, key=lib.cpShapeGetHashID):  # ids increase in the order of adding
        shape = pymunk.Poly(bodies[handle(lib.cpShapeGetBody(pointer))], [(0, 0), (1, 0), (0, 1)])
        lib.cpShapeSetUserData(pointer, lib.cpShapeGetUserData(shape._shape))
        shape._shape, shape._space = hold(pointer), weakref.ref(view)
        view._shapes[shape] = None
    for pointer in _each(view, lib.cpSpaceEachConstraint, lib.ext_cpSpaceConstraintIteratorFunc):
        a = bodies[handle(lib.cpConstraintGetBodyA(pointer))]
        b = bodies[handle(lib.cpConstraintGetBodyB(pointer))]
        constraint = _constraint(pointer, a, b)
        constraint._constraint = hold(pointer)
        view._constraints[constraint] = None
    return view


def _each(view: pymunk.Space, iterate: Callable, append: Any) -> list:
    """Return the pointers that a space's iterator visits."""
    pointers: list = []
    iterate(view._space, append, ffi.new_handle(pointers))
    return pointers


def _constraint(pointer: Any, a: pymunk.Body, b: pymunk.Body) -> pymunk.Constraint:
    """Return a pymunk constraint of the pointer's kind; its parameters are placeholders."""
    zero = (0.0, 0.0)
    if is_soft(pointer):
        return SoftSpring(a, b, zero, zero, 0.0, 0.0, 0.0)
    if lib.cpConstraintIsDampedSpring(pointer):
        return pymunk.DampedSpring(a, b, zero, zero, 0.0, 0.0, 0.0)
    if lib.cpConstraintIsSlideJoint(pointer):
        return pymunk.SlideJoint(a, b, zero, zero, 0.0, 0.0)
    return pymunk.PivotJoint(a, b, zero, zero)


def _field(name: str, text: str) -> Any:
    """Return a property that reads and writes a field of the spring's struct."""
    def read(spring: pymunk.Constraint) -> Any:
        value = layout_of(spring._constraint, SPRING)[name][0]
        return float(value) if value.ndim == 0 else pymunk.Vec2d(*value.tolist())

    def write(spring: pymunk.Constraint, value: Any) -> None:
        layout_of(spring._constraint, SPRING)[name][0] = value

    return property(read, write, doc=text)


class SoftSpring(pymunk.DampedSpring):
    """An implicit spring of the reference physics.

    Its properties access the struct, since Munk2D's functions accept only its own damped springs.
    """

    anchor_a = _field('anchor_a', 'Anchor on body a [m].')
    anchor_b = _field('anchor_b', 'Anchor on body b [m].')
    rest_length = _field('rest', 'Length at rest [m].')
    stiffness = _field('stiffness', 'Stiffness [N/m].')
    damping = _field('damping', 'Damping [N s/m].')
