"""A rosbag2 folder as lists of serialised messages, whole or left behind by a killed recorder."""

import contextlib
import io
import operator
import sqlite3
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.exceptions import EndOfFile
from mcap.records import Channel, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader
from rosbags.rosbag2 import Reader

from sim_node.errors import InvalidInput

_EXPECTED = 'a rosbag2 folder with metadata.yaml and .mcap or .db3 files'


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


class _Found:
    """What was read so far, by topic: type, times [ns] and messages."""

    def __init__(self) -> None:
        self.topics: dict[str, tuple[str, list[int], list[bytes]]] = {}

    def add_topic(self, name: str, kind: str) -> None:
        """Note that there is a topic; InvalidInput if it is known and of another type."""
        known, *_ = self.topics.setdefault(name, (kind, [], []))
        if known != kind:
            raise InvalidInput(name, kind, known)

    def add_message(self, name: str, time: int, data: bytes) -> None:
        """Add a message of a known topic."""
        _, times, messages = self.topics[name]
        times.append(time)
        messages.append(data)


def read_storage(path: Path) -> tuple[dict[str, Topic], bool]:
    """Return the topics of the bag at `path`, and whether its recorder had closed it.

    Raises:
        InvalidInput: there is no bag, or it cannot be read; the text names it and the reason.
    """
    closed = (path / 'metadata.yaml').exists()
    found = _Found()
    try:
        if closed:
            _read_whole(path, found)
        else:
            for file in _orphans(path):
                read = _read_cut_mcap if file.suffix == '.mcap' else _read_whole
                read(file, found)
    except InvalidInput as error:
        raise error.found_in(str(path)) from None
    except Exception as error:  # rosbags and mcap let whatever a damaged file provokes through
        reason = str(error) or type(error).__name__
        raise InvalidInput('bag', ' '.join(reason.split()), _EXPECTED, str(path)) from None
    topics = {
        name: Topic(kind, np.array(times, dtype=np.int64), messages)
        for name, (kind, times, messages) in found.topics.items()
    }
    return topics, closed


def _read_whole(source: Path, found: _Found) -> None:
    """Read a bag's folder, or a file of sqlite3."""
    with Reader(source) as reader:
        for connection in reader.connections:
            found.add_topic(connection.topic, connection.msgtype)
        for connection, time, data in reader.messages() if reader.connections else ():
            found.add_message(connection.topic, time, bytes(data))


def _orphans(path: Path) -> list[Path]:
    """Return the files of a bag whose recorder was killed before it wrote metadata."""
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
    return files


def _read_cut_mcap(file: Path, found: _Found) -> None:
    """Read an MCAP file up to its last whole record."""
    schemas: dict[int, str] = {}
    topics: dict[int, str] = {}
    messages: list[tuple[int, str, bytes]] = []
    for record in _whole_records(file.read_bytes()):
        if isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel):
            topics[record.id] = record.topic
            found.add_topic(record.topic, schemas[record.schema_id])
        elif isinstance(record, Message):
            messages.append((record.log_time, topics[record.channel_id], record.data))
    for time, topic, data in sorted(messages, key=operator.itemgetter(0)):  # as rosbags does
        found.add_message(topic, time, data)


def _whole_records(data: bytes) -> Iterator[McapRecord]:
    """Yield the records of an MCAP file, with those in its chunks, up to where it is cut.

    A recorder that was killed leaves no summary, and half a record perhaps.
    """
    stream = io.BytesIO(data)
    try:
        yield from StreamReader(stream, validate_crcs=True).records
    except (EndOfFile, struct.error, UnicodeDecodeError):  # what it says of half a record
        if stream.tell() < len(data):  # that is no cut
            raise
