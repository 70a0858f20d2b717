"""(ROS) Messages of fixed layout, written and read as bytes.

A robot's messages differ from step to step in their stamp and their numbers only. A `WireFormat`
serialises one with rclpy, sees that the numbers lie where its layout has them, and from then on
copies numbers in and out: the bytes are those of rclpy, at a fraction of its time.
"""

import struct
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message

from sim_node.message_layout import place

_ENCAPSULATION = slice(0, 4)
_STAMP = slice(4, 12)  # builtin_interfaces/Time leads every stamped message, after 4 bytes of CDR
_TIME = struct.Struct('<iI')  # its sec and nanosec
_MAX_KNOWN = 64


class WireFormat:
    """One kind of message: all its parts are fixed but the stamp and the named numbers.

    Args:
        message: an example.
        layout: of its bytes, from `sim_node.message_layout`. If it begins with a stamp, `encode`
            writes that, too.
        numbers: what the example holds in the fields that `encode` writes and `decode` reads, by
            their name, as arrays of the type that they are to have.
        check: called with a whole message that was not seen before; raises if its fixed parts
            are not acceptable.
    """

    def __init__(
        self,
        message: Any,
        layout: np.dtype,
        numbers: Mapping[str, np.ndarray],
        check: Callable[[Any], None] = lambda message: None,
    ) -> None:
        self._type, self._check = type(message), check
        self._data = data = _serialized(message, layout)
        self._slots = {n: (place(layout, n), values.dtype) for n, values in numbers.items()}
        for name, (where, _) in self._slots.items():
            if data[where] != numbers[name].tobytes():
                raise AssertionError(f'{self._type.__name__}: {name} is not at {where}')
        regions = [where for where, _ in self._slots.values()]
        regions += [_STAMP] * ('sec' in (layout.names or ()))
        regions.sort(key=lambda where: where.start)
        edges = [0, *(e for where in regions for e in (where.start, where.stop)), len(data)]
        self._fixed = [slice(a, b) for a, b in zip(edges[::2], edges[1::2], strict=True)]
        self._known: set[bytes] = set()

    def encode(self, stamp: tuple[int, int] | None = None, **numbers: np.ndarray) -> bytes:
        """Return the serialised message with this (sec, nanosec) and these numbers.

        What is not given stays as it was in the last message.
        """
        data = self._data
        if stamp is not None:
            _TIME.pack_into(data, _STAMP.start, *stamp)
        for name, values in numbers.items():
            where, dtype = self._slots[name]
            data[where] = np.asarray(values, dtype=dtype).tobytes()
        return bytes(data)

    def decode(self, data: bytes, *names: str) -> tuple[tuple[int, int], list[np.ndarray]]:
        """Return (sec, nanosec) and the numbers of these names of a serialised message.

        Fixed parts that were never seen before are deserialised by rclpy and checked; `check`
        or rclpy raise if they are off.
        """
        if len(data) == len(self._data):
            fixed = b''.join([data[part] for part in self._fixed])
        else:
            fixed = None
        if fixed not in self._known:
            if data[:4] != self._data[:4]:
                raise ValueError(f'encapsulation {data[:4]!r}, expected {bytes(self._data[:4])!r}')
            self._check(deserialize_message(data, self._type))
            if fixed is None:
                raise ValueError(f'{len(data)} bytes, expected {len(self._data)}')
            if len(self._known) < _MAX_KNOWN:
                self._known.add(fixed)
        slots = [self._slots[name] for name in names]
        numbers = [np.frombuffer(data[where], dtype) for where, dtype in slots]
        return _TIME.unpack_from(data, _STAMP.start), numbers


def _serialized(message: Any, layout: np.dtype) -> bytearray:
    """Return the bytes of a message, of which it is checked that they have this layout.

    rclpy leaves between two fields whatever its memory held, and reserves more at the end than
    empty sequences take. Here the gaps are zero, and the end is the layout's.
    """
    kind, example = type(message), serialize_message(message)
    data = bytearray(layout.itemsize)
    for part in (_ENCAPSULATION, *(place(layout, name) for name in layout.names or ())):
        data[part] = example[part]
    whole = len(data) == layout.itemsize
    if not whole or deserialize_message(bytes(data), kind) != deserialize_message(example, kind):
        raise AssertionError(f'{kind.__name__}: rclpy has another layout')
    return data
