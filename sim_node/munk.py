"""The few C functions of Munk2D, pymunk's engine, that compiled code calls without Python."""

from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numba import carray, types
from pymunk._chipmunk import ffi, lib
from pymunk.batch import BodyFields

from sim_node.compiled import compiled_callback

_HANDLE: Any = types.uintp
_VOID: Any = types.void
_POINTER: Any = types.CPointer(_HANDLE)


def _function(name: str, result: Any, *arguments: Any) -> Any:
    """Declare a function of pymunk's library to the compiler, by name and signature."""
    llvm.add_symbol(name, _address(name))
    return types.ExternalFunction(name, result(*arguments))


def _address(name: str) -> int:
    return int(ffi.cast('uintptr_t', ffi.addressof(lib, name)))


space_step = _function('cpSpaceStep', types.void, _HANDLE, types.float64)
space_each_body = _function('cpSpaceEachBody', types.void, _HANDLE, _HANDLE, _HANDLE)
body_each_arbiter = _function('cpBodyEachArbiter', types.void, _HANDLE, _HANDLE, _HANDLE)
arbiter_get_bodies = _function('cpArbiterGetBodies', types.void, _HANDLE, _HANDLE, _HANDLE)
spring_set_rest_length = _function(
    'cpDampedSpringSetRestLength', types.void, _HANDLE, types.float64
)

READ_BODY = _address('pmSpaceBodyGetIteratorFuncBatched')
"""Address of the iterator that copies the chosen fields of each body into a batch."""


def handle(pointer: object) -> int:
    """Return a cffi pointer as the integer that compiled code passes on."""
    return int(ffi.cast('uintptr_t', pointer))


@compiled_callback(_VOID(_HANDLE, _HANDLE, _POINTER))
def _note_contact(body, arbiter, data):
    """Set data[1] if one of the arbiter's two bodies is data[0]; data[2:4] is scratch space."""
    cells = carray(data, 4)
    arbiter_get_bodies(arbiter, cells[2:].ctypes.data, cells[3:].ctypes.data)
    if cells[2] == cells[0] or cells[3] == cells[0]:
        cells[1] = 1


NOTE_CONTACT = _note_contact.address
"""Address of the iterator that notes whether a body touches the ground."""


class BodyReader:
    """Copies position, angle and velocity of all bodies of a space into one array.

    Attributes:
        rows: (n_bodies, 5) x [m], y [m], angle [rad], v_x [m/s], v_y [m/s].
        batch: handle to pass to `space_each_body` with `READ_BODY`.
        filled: (1,) int32 view of the batch's fill count; set to 0 before each reading.
    """

    def __init__(self, n_bodies: int) -> None:
        fields = BodyFields.POSITION | BodyFields.ANGLE | BodyFields.VELOCITY
        # Munk2D grows (reallocates) a batch before it is full: leave more than enough room.
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
