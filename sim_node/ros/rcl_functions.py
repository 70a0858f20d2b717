"""(ROS) Functions of rcl, the C library below rclpy, that compiled code calls.

rclpy takes and publishes a serialised message with a dozen Python objects, which is most of the
cost of a control step. If `AVAILABLE` is true, compiled code calls rcl directly.
"""

import ctypes
import weakref
from typing import Any

import llvmlite.binding as llvm
import numpy as np
from numba import types
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

_N_ARGUMENTS = {'rcl_take_serialized_message': 4, 'rcl_publish_serialized_message': 3}
_SUCCESS = 0


class _Allocator(ctypes.Structure):
    """rcutils_allocator_t: four functions and their state."""

    _fields_ = [(name, ctypes.c_void_p) for name in ('allocate', 'free', 'resize', 'zero', 'state')]


class _Message(ctypes.Structure):
    """rcl_serialized_message_t."""

    _fields_ = [
        ('buffer', ctypes.c_void_p), ('length', ctypes.c_size_t), ('capacity', ctypes.c_size_t),
        ('allocator', _Allocator),
    ]


def _library(name: str) -> ctypes.CDLL | None:
    try:
        return ctypes.CDLL(f'lib{name}.so')
    except OSError:
        return None


def _declare_functions() -> bool:
    """Make the addresses of the functions known to the compiler; return whether all exist."""
    rcl, rcutils = _library('rcl'), _library('rcutils')
    if rcl is None or rcutils is None:
        return False
    in_rcl = all(hasattr(rcl, name) for name in _N_ARGUMENTS)
    if not in_rcl or not hasattr(rcutils, 'rcutils_uint8_array_init'):
        return False
    for name in _N_ARGUMENTS:
        llvm.add_symbol(name, ctypes.cast(getattr(rcl, name), ctypes.c_void_p).value)
    return True


AVAILABLE: bool = _declare_functions()
"""Whether this ROS has the libraries and functions."""

rcl_take, rcl_publish = (
    types.ExternalFunction(name, types.int32(*[types.uintp] * n))
    for name, n in _N_ARGUMENTS.items()
)
"""Their arguments are addresses; they return 0 if they succeed.

rcl_take: subscription, message, rmw_message_info_t, allocation or 0. It succeeds if there is a
message. rcl_publish: publisher, message, allocation or 0.
"""

MESSAGE_WORDS = ctypes.sizeof(_Message) // ctypes.sizeof(ctypes.c_void_p)
"""Length of an rcl_serialized_message_t in words, of which the first two are buffer and length."""

INFO_WORDS = 32
"""Words that are enough for an rmw_message_info_t, which has 11 in Jazzy."""


def messages_to_take(n: int, capacity: int) -> np.ndarray:
    """Return n messages with buffers of their own, (n, MESSAGE_WORDS) uintp.

    rcl enlarges a buffer that is too small. The buffers are freed with the array.

    Args:
        n: number of messages.
        capacity: initial size of each buffer [bytes].
    """
    rcutils = ctypes.CDLL('librcutils.so')
    rcutils.rcutils_get_default_allocator.restype = _Allocator
    allocator = rcutils.rcutils_get_default_allocator()
    words = np.zeros((n, MESSAGE_WORDS), dtype=np.uintp)
    for message in words:
        address = ctypes.c_void_p(message.ctypes.data)
        size = ctypes.c_size_t(capacity)
        if rcutils.rcutils_uint8_array_init(address, size, ctypes.byref(allocator)) != _SUCCESS:
            raise MemoryError(f'{capacity} bytes for a message')
    owner = words.view()
    weakref.finalize(owner, _free, rcutils, words)
    return owner


def _free(rcutils: ctypes.CDLL, words: np.ndarray) -> None:
    for message in words:
        rcutils.rcutils_uint8_array_fini(ctypes.c_void_p(message.ctypes.data))


def message_to_publish(content: np.ndarray) -> np.ndarray:
    """Return a message whose buffer is `content`, (n,) uint8, which the caller keeps alive."""
    message = np.zeros(MESSAGE_WORDS, dtype=np.uintp)
    message[:3] = content.ctypes.data, len(content), len(content)
    return message


def content(message: np.ndarray) -> bytes:
    """Return the bytes of a message."""
    return ctypes.string_at(int(message[0]), int(message[1]))


def address(endpoint: Publisher | Subscription) -> int:
    """Return the address of the rcl_publisher_t or rcl_subscription_t of an endpoint."""
    handle: Any = endpoint.handle
    return handle.pointer
