"""Reads the last diagnostics of each node of a recorded graph from /diagnostics."""

import contextlib
import math
import struct
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from snca_ros.recording.storage import Topic

TOPIC, _TYPE = '/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray'
OUTCOMES = ('on time', 'late', 'lost')
_MEASURED = ('per second', '[ms]')  # ends of the names of values that are not counts


@dataclass(frozen=True)
class NodeHealth:
    """The last diagnostics of a node.

    Attributes:
        n_processes: number of processes that ran the node, one after the other.
        values: numbers by name; counts are summed over all processes, other values are those of
            the last one. What a process did after its last diagnostics, up to a second before it
            ended, is missing.
    """

    n_processes: int
    values: Mapping[str, float]

    @property
    def deliveries(self) -> dict[str, tuple[int, ...]]:
        """Return the numbers of messages on time, late and lost, by subscribed topic."""
        topics = [key[: -len(' on time')] for key in self.values if key.endswith(' on time')]
        return {
            topic: tuple(int(self.values.get(f'{topic} {outcome}', 0)) for outcome in OUTCOMES)
            for topic in topics
        }


def read_health(topics: Mapping[str, Topic], robot: str) -> tuple[dict[str, NodeHealth], int]:
    """Return the last diagnostics of each node of a robot, by its name without the namespace.

    Any process can publish on /diagnostics. A status that cannot be read is refused, the others of
    its message are not.

    Returns:
        The diagnostics, and the number of refused items: a status, the rest of a damaged message,
        or a message of another type.
    """
    by_process: dict[str, dict[str, dict[str, float]]] = {}  # node: process: values
    if TOPIC not in topics:
        return {}, 0
    topic = topics[TOPIC]
    if topic.type != _TYPE:
        return {}, len(topic.messages) + topic.foreign
    refused, prefix = topic.foreign, f'/{robot}/'.encode()
    for data in topic.messages:
        try:
            for name, process, values in _statuses(data):
                if not _is_text(name, process, *values, *values.values()):
                    refused += 1
                elif name.startswith(prefix) and b'/' not in name[len(prefix):]:
                    node = name[len(prefix):].decode()
                    by_process.setdefault(node, {})[process.decode()] = _numbers(values)
        except (struct.error, IndexError, ValueError):  # the message ends too early
            refused += 1
    return {node: _merge(list(found.values())) for node, found in by_process.items()}, refused


def _statuses(data: bytes) -> Iterator[tuple[bytes, bytes, dict[bytes, bytes]]]:
    """Yield name, hardware_id and values of each status of a serialised DiagnosticArray.

    Other readers refuse the whole message if one string is not UTF-8, so this reads bytes.

    Raises:
        struct.error, IndexError, ValueError: the message is damaged from here on.
    """
    read = _Reader(data)
    read.number(), read.number(), read.string()  # stamp and frame_id
    for _ in range(read.number()):
        read.byte()  # level
        name, _, process = read.string(), read.string(), read.string()
        yield name, process, dict(
            [(read.string(), read.string()) for _ in range(read.number())]
        )


class _Reader:
    """Reads the fields of a serialised message (CDR), one after the other."""

    def __init__(self, data: bytes) -> None:
        self._data, self._at = data[4:], 0  # after the encapsulation
        self._number = struct.Struct('<I' if data[1] & 1 else '>I')

    def byte(self) -> int:
        """Return the next byte."""
        self._at += 1
        return self._data[self._at - 1]

    def number(self) -> int:
        """Return the next uint32, which is aligned to its size."""
        begin = -(-self._at // 4) * 4
        self._at = begin + 4
        return self._number.unpack_from(self._data, begin)[0]

    def string(self) -> bytes:
        """Return the next string without its terminating zero."""
        size = self.number()
        begin, self._at = self._at, self._at + size
        if self._at > len(self._data):
            raise ValueError(f'a string of {size} bytes')
        return self._data[begin : self._at].removesuffix(b'\0')


def _is_text(*strings: bytes) -> bool:
    """Return whether all strings are UTF-8."""
    try:
        b'\0'.join(strings).decode()
    except UnicodeDecodeError:
        return False
    return True


def _numbers(values: Mapping[bytes, bytes]) -> dict[str, float]:
    """Return the values that are finite numbers; nodes of others may publish texts."""
    numbers = {}
    for key, value in values.items():
        with contextlib.suppress(ValueError):
            number = float(value)
            if math.isfinite(number):
                numbers[key.decode()] = number
    return numbers


def _merge(processes: list[dict[str, float]]) -> NodeHealth:
    counts = {key for values in processes for key in values if not key.endswith(_MEASURED)}
    totals = {key: sum(values.get(key, 0.0) for values in processes) for key in sorted(counts)}
    return NodeHealth(len(processes), {**processes[-1], **totals})
