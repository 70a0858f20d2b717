"""(ROS) Messages of fixed layout, written and read as bytes.

A robot's messages differ from step to step in their stamp and their numbers only. A `WireFormat`
serialises one with rclpy, finds where the numbers lie, and from then on copies numbers in and
out: the bytes are those of rclpy, at a fraction of its time.
"""

import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from rclpy.serialization import deserialize_message, serialize_message

_STAMP = slice(4, 12)  # builtin_interfaces/Time leads every stamped message, after 4 bytes of CDR
_TIME = struct.Struct('<iI')  # its sec and nanosec
_MAX_KNOWN = 64


class WireFormat:
    """One kind of message: all its parts are fixed but the stamp and the named numbers.

    Args:
        message: an example; where it holds one of `numbers`, it holds exactly these values.
        numbers: arrays of distinct non-zero values, each standing once in the message; they give
            type, length and place of what `encode` writes and `decode` reads.
        tail: bytes behind the last number, where rclpy reserves more than the message takes (it
            does so for empty sequences); None to keep what rclpy gives.
        stamped: its first field is a header or a time, which `encode` writes too.
        check: called with a whole message that was not seen before; raises if its fixed parts
            are not acceptable.
    """

    def __init__(
        self,
        message: Any,
        numbers: dict[str, np.ndarray],
        *,
        tail: int | None = None,
        stamped: bool = True,
        check: Callable[[Any], None] = lambda message: None,
    ) -> None:
        self._type, self._check = type(message), check
        data = bytearray(serialize_message(message))
        self._slots: dict[str, tuple[slice, np.dtype]] = {}
        for name, values in numbers.items():
            needle = values.tobytes()
            begin = data.find(needle)
            if begin < 0 or data.find(needle, begin + 1) >= 0:
                raise AssertionError(f'{self._type.__name__}: {name} must stand once')
            self._slots[name] = slice(begin, begin + len(needle)), values.dtype
        if tail is not None:
            del data[max(where.stop for where, _ in self._slots.values()) + tail :]
        self._data = data
        regions = [where for where, _ in self._slots.values()] + [_STAMP] * stamped
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
