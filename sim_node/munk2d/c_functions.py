"""Declarations of the C functions of Munk2D, pymunk's engine, for compiled code.

Two of Munk2D's structs are passed by value: `cpVect` as its two doubles, and `cpShapeFilter` as two
integers, group and category | mask << 32. The calling conventions of x86-64 (System V) and AArch64
pass either struct in the same registers as its parts while there are enough registers: eight
doubles, six integers.
"""

from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numba import carray, types
from numba.extending import intrinsic
from pymunk._chipmunk import ffi, lib
from pymunk.batch import BodyFields

from sim_node.numerics.jit import compiled_callback

_HANDLE: Any = types.uintp
_REAL: Any = types.float64
_VECTOR = _REAL, _REAL
_VOID: Any = types.void
_POINTER: Any = types.CPointer(_HANDLE)

STEP_CALLBACK = _VOID(_HANDLE, _REAL)
"""Signature of functions that Munk2D calls with a body or constraint and the step [s]."""


def _function(name: str, result: Any, *arguments: Any) -> Any:
    """Declare a function of pymunk's C library to the compiler, by name and signature."""
    llvm.add_symbol(name, _address(name))
    return types.ExternalFunction(name, result(*arguments))


def _address(name: str) -> int:
    return int(ffi.cast('uintptr_t', ffi.addressof(lib, name)))


space_step = _function('cpSpaceStep', _VOID, _HANDLE, _REAL)
space_each_body = _function('cpSpaceEachBody', _VOID, _HANDLE, _HANDLE, _HANDLE)
space_add_body = _function('cpSpaceAddBody', _HANDLE, _HANDLE, _HANDLE)
space_add_shape = _function('cpSpaceAddShape', _HANDLE, _HANDLE, _HANDLE)
space_add_constraint = _function('cpSpaceAddConstraint', _HANDLE, _HANDLE, _HANDLE)
space_free = _function('cpSpaceFree', _VOID, _HANDLE)

body_new = _function('cpBodyNew', _HANDLE, _REAL, _REAL)
body_set_position = _function('cpBodySetPosition', _VOID, _HANDLE, *_VECTOR)
body_set_position_function = _function('cpBodySetPositionUpdateFunc', _VOID, _HANDLE, _HANDLE)
body_update_position = _function('cpBodyUpdatePosition', _VOID, _HANDLE, _REAL)
body_each_arbiter = _function('cpBodyEachArbiter', _VOID, _HANDLE, _HANDLE, _HANDLE)
body_free = _function('cpBodyFree', _VOID, _HANDLE)
arbiter_get_bodies = _function('cpArbiterGetBodies', _VOID, _HANDLE, _HANDLE, _HANDLE)

box_new = _function('cpBoxShapeNew', _HANDLE, _HANDLE, _REAL, _REAL, _REAL)
polygon_new = _function('cpPolyShapeNewRaw', _HANDLE, _HANDLE, types.int32, _HANDLE, _REAL)
shape_set_friction = _function('cpShapeSetFriction', _VOID, _HANDLE, _REAL)
shape_set_elasticity = _function('cpShapeSetElasticity', _VOID, _HANDLE, _REAL)
shape_set_filter = _function('cpShapeSetFilter', _VOID, _HANDLE, types.uint64, types.uint64)
shape_free = _function('cpShapeFree', _VOID, _HANDLE)

spring_new = _function(
    'cpDampedSpringNew', _HANDLE, _HANDLE, _HANDLE, *_VECTOR, *_VECTOR, _REAL, _REAL, _REAL
)
limit_new = _function(
    'cpSlideJointNew', _HANDLE, _HANDLE, _HANDLE, *_VECTOR, *_VECTOR, _REAL, _REAL
)
pivot_new = _function('cpPivotJointNew2', _HANDLE, _HANDLE, _HANDLE, *_VECTOR, *_VECTOR)
constraint_set_collide_bodies = _function(
    'cpConstraintSetCollideBodies', _VOID, _HANDLE, types.int32
)
constraint_free = _function('cpConstraintFree', _VOID, _HANDLE)


def _rest_length_offset() -> int:
    """Return the offset [bytes] of the rest length in Munk2D's struct of a damped spring.

    The offset is found in a new spring, as the place of the value that Munk2D's setter has set.
    """
    bodies = [ffi.gc(lib.cpBodyNew(1.0, 1.0), lib.cpBodyFree) for _ in range(2)]
    marker = 0.1234567890123
    spring = ffi.gc(
        lib.cpDampedSpringNew(*bodies, (0.0, 0.0), (0.0, 0.0), marker, 1.0, 1.0),
        lib.cpConstraintFree,
    )
    numbers = ffi.cast('double *', spring)
    index = 0
    while numbers[index] != marker:  # ends inside the struct, which holds the value
        index += 1
    lib.cpDampedSpringSetRestLength(spring, 2.0 * marker)
    if numbers[index] != 2.0 * marker:
        raise ImportError('this version of pymunk stores the rest length of a spring differently')
    return index * ffi.sizeof('double')


REST_LENGTH = np.uintp(_rest_length_offset())
"""Offset [bytes] of the rest length in Munk2D's struct of a damped spring."""


@intrinsic
def store_real(typing, address, value):
    """Write a double to an address.

    Munk2D's setter of a rest length also wakes both bodies, which never sleep here. Writing to the
    struct instead saves 4 % of an episode.
    """

    def generate(context, builder, signature, args):
        address, value = args
        builder.store(value, builder.inttoptr(address, value.type.as_pointer()))
        return context.get_dummy_value()

    return _VOID(_HANDLE, _REAL), generate


@intrinsic
def record_at(typing, address, record):
    """Return the struct at an address as a record of the given type (from `numba.from_dtype`)."""
    kind = record.instance_type

    def generate(context, builder, signature, args):
        return builder.inttoptr(args[0], context.get_value_type(kind))

    return kind(_HANDLE, record), generate


READ_BODY = _address('pmSpaceBodyGetIteratorFuncBatched')
"""Address of the iterator that copies the chosen fields of each body into a batch."""


def handle(pointer: object) -> int:
    """Return a cffi pointer as an integer, the form that compiled code uses."""
    return int(ffi.cast('uintptr_t', pointer))


@compiled_callback(_VOID(_HANDLE, _HANDLE, _POINTER))
def _note_contact(body, arbiter, data):
    """Set data[1] to 1 if a contact involves the body data[0]; data[2:4] is scratch space."""
    cells = carray(data, 4)
    arbiter_get_bodies(arbiter, cells[2:].ctypes.data, cells[3:].ctypes.data)
    if cells[2] == cells[0] or cells[3] == cells[0]:
        cells[1] = 1


@compiled_callback(STEP_CALLBACK)
def _stay(body, dt):
    """Leave a body where it is: the engine moves it at the end of a step."""


STAY = _stay.address
"""Address of the position function of bodies that Munk2D's own step must not move."""

NOTE_CONTACT = _note_contact.address
"""Address of the iterator that records whether a body touches the ground."""


class BodyReader:
    """Copies position, angle and velocity of all bodies of a space into one array.

    Attributes:
        rows: (n_bodies, 5) x [m], y [m], angle [rad], v_x [m/s], v_y [m/s].
        batch: handle to pass to `space_each_body` with `READ_BODY`.
        filled: (1,) int32 view of the batch's fill count; set to 0 before each reading.
    """

    def __init__(self, n_bodies: int) -> None:
        fields = BodyFields.POSITION | BodyFields.ANGLE | BodyFields.VELOCITY
        # Munk2D reallocates a batch before it is full: make the buffer larger than needed.
        buffer = np.zeros((n_bodies + 8, 5))
        self.rows = buffer[:n_bodies]
        self._floats = ffi.new('pmFloatArray *')
        self._floats.arr = ffi.cast('double *', buffer.ctypes.data)
        self._floats.max = buffer.size
        self._batch = ffi.new('pmBatchedData *')
        self._batch.fields = fields.value
        self._batch.floatArray = self._floats
        self.batch = handle(self._batch)
        fill_count = ffi.buffer(ffi.addressof(self._floats[0], 'num'), 4)
        self.filled = np.frombuffer(fill_count, dtype=np.int32)
