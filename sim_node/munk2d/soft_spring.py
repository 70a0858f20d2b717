"""An implicit spring for Munk2D's space: a soft constraint in place of its damped spring.

A soft constraint integrates a spring implicitly (Catto, "Soft constraints", GDC 2011; dyn4j's
DistanceJoint): with step h, stiffness k, damping c, extension x, the effective mass 1/K of the
present pose and the accumulated impulse L,

    gamma = 1 / (h (c + h k)),    j = -(v + x h k gamma + gamma L) / (K + gamma),    L <- L + j.

With share = K / (K + gamma) and, before the first sweep, target = -gamma (x h k + L), this is

    j = (target - v) share / K,    target <- v + (target - v) share,

which is the sweep of Munk2D's damped spring. So a soft spring is a damped spring of Munk2D with a
different preparation and with warm starting. The sweep is implemented here, too, because a step is
then a tenth faster than with Munk2D's.

The callbacks read and write Munk2D's structs. The layout is declared here, and checked at import.
"""

import math
from typing import Any

import numba
import numpy as np
from pymunk._chipmunk import ffi, lib

from sim_node.munk2d import c_functions as munk
from sim_node.numerics.jit import compiled_callback, compiled_inline

_VECTOR = (np.float64, (2,))

BODY = np.dtype([
    ('functions', np.uintp, (2,)), ('mass', np.float64), ('inverse_mass', np.float64),
    ('moment', np.float64), ('inverse_moment', np.float64), ('center_of_gravity', *_VECTOR),
    ('position', *_VECTOR), ('velocity', *_VECTOR), ('force', *_VECTOR), ('angle', np.float64),
    ('spin', np.float64), ('torque', np.float64), ('axes', np.float64, (4,)),
])
"""The beginning of Munk2D's cpBody; `axes` is its rotation matrix, column by column."""

SPRING = np.dtype([
    ('functions', np.uintp), ('space', np.uintp), ('a', np.uintp), ('b', np.uintp),
    ('next', np.uintp, (2,)), ('max_force', np.float64), ('error_bias', np.float64),
    ('max_bias', np.float64), ('collide_bodies', np.uintp), ('callbacks', np.uintp, (2,)),
    ('user_data', np.uintp), ('anchor_a', *_VECTOR), ('anchor_b', *_VECTOR),
    ('rest', np.float64), ('stiffness', np.float64), ('damping', np.float64),
    ('force_function', np.uintp), ('target', np.float64), ('share', np.float64),
    ('arm_a', *_VECTOR), ('arm_b', *_VECTOR), ('mass', np.float64), ('axis', *_VECTOR),
    ('impulse', np.float64),
])
"""Munk2D's cpDampedSpring; `mass` is the effective mass, `axis` the unit vector from a to b."""

_BODY: Any = numba.from_dtype(BODY)
_SPRING: Any = numba.from_dtype(SPRING)


@compiled_inline
def _apply_impulse(a, b, spring, impulse):
    """Apply an impulse along the spring's axis to both bodies, positive if it drives them apart."""
    x, y = spring.axis[0] * impulse, spring.axis[1] * impulse
    a.velocity[0] -= x * a.inverse_mass
    a.velocity[1] -= y * a.inverse_mass
    a.spin -= a.inverse_moment * (spring.arm_a[0] * y - spring.arm_a[1] * x)
    b.velocity[0] += x * b.inverse_mass
    b.velocity[1] += y * b.inverse_mass
    b.spin += b.inverse_moment * (spring.arm_b[0] * y - spring.arm_b[1] * x)


@compiled_callback(munk.STEP_CALLBACK)
def _prepare(constraint, h):
    """Prepare a spring at the present poses for a physics step of `h` [s] (Munk2D's preStep)."""
    spring = munk.record_at(constraint, _SPRING)
    a, b = munk.record_at(spring.a, _BODY), munk.record_at(spring.b, _BODY)
    for arm, body, anchor in (
        (spring.arm_a, a, spring.anchor_a), (spring.arm_b, b, spring.anchor_b)
    ):
        arm[0] = body.axes[0] * anchor[0] + body.axes[2] * anchor[1]
        arm[1] = body.axes[1] * anchor[0] + body.axes[3] * anchor[1]
    x = b.position[0] + spring.arm_b[0] - a.position[0] - spring.arm_a[0]
    y = b.position[1] + spring.arm_b[1] - a.position[1] - spring.arm_a[1]
    length = math.sqrt(x * x + y * y)
    scale = 1.0 / length if length > 0.0 else 0.0
    spring.axis[0], spring.axis[1] = x * scale, y * scale
    across_a = spring.arm_a[0] * spring.axis[1] - spring.arm_a[1] * spring.axis[0]
    across_b = spring.arm_b[0] * spring.axis[1] - spring.arm_b[1] * spring.axis[0]
    inverse = (
        a.inverse_mass + a.inverse_moment * across_a * across_a
        + b.inverse_mass + b.inverse_moment * across_b * across_b
    )
    pull = h * spring.stiffness
    gamma = 1.0 / (h * (spring.damping + pull))
    spring.mass = 1.0 / inverse
    spring.share = inverse / (inverse + gamma)
    spring.target = -gamma * ((length - spring.rest) * pull + spring.impulse)


@compiled_callback(munk.STEP_CALLBACK)
def _warm_start(constraint, ratio):
    """Apply the last step's impulse times `ratio`, the quotient of this and the last step [s]."""
    spring = munk.record_at(constraint, _SPRING)
    a, b = munk.record_at(spring.a, _BODY), munk.record_at(spring.b, _BODY)
    _apply_impulse(a, b, spring, spring.impulse * ratio)


@compiled_callback(munk.STEP_CALLBACK)
def _sweep(constraint, h):
    """Apply a spring once, in one sweep of the impulse solver (Munk2D's applyImpulse)."""
    spring = munk.record_at(constraint, _SPRING)
    a, b = munk.record_at(spring.a, _BODY), munk.record_at(spring.b, _BODY)
    x, y = spring.axis[0], spring.axis[1]
    speed_a = (
        x * (a.velocity[0] - spring.arm_a[1] * a.spin)
        + y * (a.velocity[1] + spring.arm_a[0] * a.spin)
    )
    speed_b = (
        x * (b.velocity[0] - spring.arm_b[1] * b.spin)
        + y * (b.velocity[1] + spring.arm_b[0] * b.spin)
    )
    speed = speed_b - speed_a
    change = (spring.target - speed) * spring.share
    spring.target = speed + change
    impulse = change * spring.mass
    spring.impulse += impulse
    _apply_impulse(a, b, spring, impulse)


def layout_of(pointer: Any, layout: np.dtype) -> np.ndarray:
    """Return a writable view, (1,) of dtype `layout`, of the struct at a cffi pointer."""
    return np.frombuffer(ffi.buffer(ffi.cast('char *', pointer), layout.itemsize), layout)


def _functions() -> np.ndarray:
    """Return the four function addresses of soft springs; that of `getImpulse` is Munk2D's.

    Raises:
        ImportError: Munk2D's structs have another layout than is declared above.
    """
    space = ffi.gc(lib.cpSpaceNew(), lib.cpSpaceFree)
    bodies = [ffi.gc(lib.cpBodyNew(m, 5.0 * m), lib.cpBodyFree) for m in (2.0, 3.0)]
    for body, x in zip(bodies, (0.0, 4.0), strict=True):
        lib.cpBodySetPosition(body, (x, 0.5))
        lib.cpBodySetAngle(body, 0.5 * math.pi)
        lib.cpBodySetVelocity(body, (x, 0.25))
        lib.cpBodySetAngularVelocity(body, 0.125)
    anchors = (0.5, -1.0), (0.5, -1.5)
    spring = ffi.gc(lib.cpDampedSpringNew(*bodies, *anchors, 2.5, 7.0, 1.5), lib.cpConstraintFree)
    seen, a, b = layout_of(spring, SPRING)[0], *(layout_of(body, BODY)[0] for body in bodies)
    given: list[tuple[Any, Any]] = [
        (a['mass'], 2.0), (a['inverse_mass'], 0.5), (b['inverse_moment'], 1.0 / 15.0),
        (a['center_of_gravity'], 0.0), (b['position'], (4.0, 0.5)), (b['velocity'], (4.0, 0.25)),
        (a['force'], 0.0), (b['angle'], 0.5 * math.pi), (b['spin'], 0.125), (a['torque'], 0.0),
        (a['axes'], (0.0, 1.0, -1.0, 0.0)), (seen['a'], munk.handle(bodies[0])),
        (seen['b'], munk.handle(bodies[1])), (seen['anchor_a'], anchors[0]),
        (seen['anchor_b'], anchors[1]), (seen['rest'], 2.5), (seen['stiffness'], 7.0),
        (seen['damping'], 1.5),
    ]
    fits = all(np.allclose(value, expected, rtol=0.0, atol=1e-12) for value, expected in given)
    if fits:
        for body in bodies:
            lib.cpSpaceAddBody(space, body)
        lib.cpSpaceAddConstraint(space, spring)
        lib.cpSpaceStep(space, 1e-6)  # so short that nothing has moved
        inverse = 0.5 + 1.0 / 3.0 + 0.5**2 / 10.0 + 0.5**2 / 15.0
        computed: list[tuple[Any, Any]] = [
            (seen['arm_a'], (1.0, 0.5)), (seen['arm_b'], (1.5, 0.5)), (seen['axis'], (1.0, 0.0)),
            (seen['mass'], 1.0 / inverse), (seen['share'], 1.5e-6 * inverse),
            (seen['impulse'], lib.cpConstraintGetImpulse(spring)), (seen['target'], 4.0),
        ]
        fits = all(np.allclose(value, expected, 1e-4, 1e-7) for value, expected in computed)
        lib.cpSpaceRemoveConstraint(space, spring)
        for body in bodies:
            lib.cpSpaceRemoveBody(space, body)
    if not fits:
        raise ImportError('this pymunk keeps its springs in another form; pymunk>=7,<8 is known')
    stock = np.frombuffer(ffi.buffer(ffi.cast('char *', int(seen['functions'])), 32), np.uintp)
    return np.array([_prepare.address, _warm_start.address, _sweep.address, stock[3]], np.uintp)


FUNCTIONS = _functions()
"""Munk2D's cpConstraintClass of soft springs: addresses of prepare, warm start, sweep, impulse.

The array must not be freed before the springs.
"""

ADDRESS = FUNCTIONS.ctypes.data
"""Address of `FUNCTIONS`."""


@compiled_inline
def soften(spring, functions):
    """Turn a damped spring, given by its handle, into a soft one; `functions` is `ADDRESS`."""
    munk.record_at(spring, _SPRING).functions = functions


def is_soft(pointer: Any) -> bool:
    """Return whether a constraint, a cffi pointer, is a soft spring."""
    first = np.frombuffer(ffi.buffer(ffi.cast('char *', pointer), 8), np.uintp)
    return int(first[0]) == ADDRESS
