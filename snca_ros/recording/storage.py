"""A rosbag2 folder as lists of serialised messages, whole or left behind by a killed recorder."""

import contextlib
import io
import sqlite3
import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.rosbag2 import Reader

from sim_node.errors import InvalidInput

_EXPECTED = 'a rosbag2 folder with metadata.yaml and .mcap or .db3 files'
_MAGIC = b'\x89MCAP0\r\n'
_RECORD_HEAD = struct.Struct('<BQ')
_FOOTER_WITHOUT_SUMMARY = b'\x02' + (20).to_bytes(8, 'little') + bytes(20)


@dataclass(frozen=True, eq=False)
class Topic:
    """What a bag holds of one topic.

    Attributes:
        type: such as 'sensor_msgs/msg/JointState'.
        times: (n,) wall time at which each message was recorded [ns], in the bag's order.
        messages: n serialised messages.
    """

    type: str
    times: np.ndarray
    messages: list[bytes]


def read_storage(path: Path) -> tuple[dict[str, Topic], bool]:
    """Return the topics of the bag at `path`, and whether its recorder had closed it.

    Raises:
        InvalidInput: there is no bag, or it cannot be read; the text names it and the reason.
    """
    closed = (path / 'metadata.yaml').exists()
    try:
        found: dict[str, tuple[str, list[int], list[bytes]]] = {}
        for source in [path] if closed else _orphans(path):
            with Reader(source) as reader:
                for connection in reader.connections:
                    kind, *_ = found.setdefault(connection.topic, (connection.msgtype, [], []))
                    if kind != connection.msgtype:
                        raise InvalidInput(connection.topic, connection.msgtype, kind)
                for connection, time, data in reader.messages() if found else ():
                    _, times, messages = found[connection.topic]
                    times.append(time)
                    messages.append(bytes(data))
    except InvalidInput as error:
        raise error.found_in(str(path)) from None
    except Exception as error:  # rosbags lets whatever a damaged file provokes through
        reason = str(error) or type(error).__name__
        raise InvalidInput('bag', ' '.join(reason.split()), _EXPECTED, str(path)) from None
    topics = {
        name: Topic(kind, np.array(times, dtype=np.int64), messages)
        for name, (kind, times, messages) in found.items()
    }
    return topics, closed


def _orphans(path: Path) -> list[Any]:
    """Return what to read of a bag whose recorder was killed before it wrote metadata.

    These are paths, as far as rosbags is concerned.
    """
    if not path.is_dir():
        raise InvalidInput('bag', 'a file' if path.exists() else 'no such folder', _EXPECTED)
    files = sorted(p for p in path.iterdir() if p.suffix in ('.mcap', '.db3'))
    if not files:
        raise InvalidInput('bag', 'a folder without these', _EXPECTED)
    for file in files:
        if file.with_name(f'{file.name}-journal').exists():
            # Opening it lets SQLite take back what was not committed.
            with contextlib.closing(sqlite3.connect(file)) as database:
                database.execute('SELECT count(*) FROM messages').fetchone()
    return [_MendedMcap(p) if p.suffix == '.mcap' else p for p in files]


class _MendedMcap:
    """An MCAP file that ends after its last whole record; to rosbags a path.

    A recorder that was killed leaves no summary, and half a record perhaps; rosbags reads a file
    without summary from end to end, but wants the closing bytes.
    """

    suffix = '.mcap'

    def __init__(self, path: Path) -> None:
        self._path = path

    def __str__(self) -> str:
        return str(self._path)

    def exists(self) -> bool:
        return self._path.exists()

    def is_dir(self) -> bool:
        return False

    def open(self, mode: str) -> io.BytesIO:
        data = self._path.read_bytes()
        if data[-len(_MAGIC) :] == _MAGIC and len(data) > len(_MAGIC):
            return io.BytesIO(data)
        end = len(_MAGIC)
        while end + _RECORD_HEAD.size <= len(data):
            _, size = _RECORD_HEAD.unpack_from(data, end)
            if end + _RECORD_HEAD.size + size > len(data):
                break
            end += _RECORD_HEAD.size + size
        return io.BytesIO(data[:end] + _FOOTER_WITHOUT_SUMMARY + _MAGIC)
