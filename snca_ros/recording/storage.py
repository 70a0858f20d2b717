"""Reads the serialised messages of a rosbag2 folder, also of one that was not closed."""

import contextlib
import io
import operator
import sqlite3
import struct
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.exceptions import EndOfFile
from mcap.records import Channel, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader
from rosbags.rosbag2 import Reader

from sim_node.errors import InvalidInput
from snca_ros.files import NOT_IN_SQLITE

_EXPECTED = 'a rosbag2 folder with metadata.yaml and .mcap or .db3 files'


@dataclass(frozen=True, eq=False)
class Topic:
    """One topic of a bag.

    Attributes:
        type: message type, such as 'sensor_msgs/msg/JointState'.
        times: (n,) wall time at which each message was recorded [ns], in the bag's order.
        messages: n serialised messages.
    """

    type: str
    times: np.ndarray
    messages: list[bytes]


class _Contents:
    """The messages read so far, by topic: type, times [ns] and messages."""

    def __init__(self) -> None:
        self.topics: dict[str, tuple[str, list[int], list[bytes]]] = {}

    def add_topic(self, name: str, kind: str) -> None:
        """Add a topic unless it is known; raise InvalidInput if it has another type."""
        known, *_ = self.topics.setdefault(name, (kind, [], []))
        if known != kind:
            raise InvalidInput(name, kind, known)

    def add_message(self, name: str, time: int, data: bytes) -> None:
        """Add a message of a known topic."""
        _, times, messages = self.topics[name]
        times.append(time)
        messages.append(data)


def read_storage(path: Path) -> tuple[dict[str, Topic], bool]:
    """Return the topics of the bag at `path`, and whether its recorder closed it.

    Raises:
        InvalidInput: there is no bag, or it cannot be read; the text names it and the reason.
    """
    closed = (path / 'metadata.yaml').exists()
    found = _Contents()
    try:
        if closed:
            _read_closed(path, found)
        else:
            for file in _files_of_unclosed_bag(path):
                read = _read_truncated_mcap if file.suffix == '.mcap' else _read_closed
                read(file, found)
    except InvalidInput as error:
        raise error.found_in(str(path)) from None
    except Exception as error:  # rosbags and mcap raise various ones for a damaged file
        reason = str(error) or type(error).__name__
        raise InvalidInput('bag', ' '.join(reason.split()), _EXPECTED, str(path)) from None
    topics = {
        name: Topic(kind, np.array(times, dtype=np.int64), messages)
        for name, (kind, times, messages) in found.topics.items()
    }
    return topics, closed


def _read_closed(source: Path, found: _Contents) -> None:
    """Read the folder of a closed bag, or an sqlite3 file."""
    files = [source] if source.is_file() else sorted(source.glob('*.db3'))
    if any(NOT_IN_SQLITE.intersection(str(file.absolute())) for file in files):
        with tempfile.TemporaryDirectory(prefix='snca_ros_') as folder:
            for i, file in enumerate(files):
                link = Path(folder) / f'{i}.db3'
                link.symlink_to(file.absolute())
                _read_by_rosbags(link, found)
    else:
        _read_by_rosbags(source, found)


def _read_by_rosbags(source: Path, found: _Contents) -> None:
    with Reader(source) as reader:
        for connection in reader.connections:
            found.add_topic(connection.topic, connection.msgtype)
        for connection, time, data in reader.messages() if reader.connections else ():
            found.add_message(connection.topic, time, bytes(data))


def _files_of_unclosed_bag(path: Path) -> list[Path]:
    """Return the files of a bag whose recorder was killed before it wrote metadata."""
    if not path.is_dir():
        raise InvalidInput('bag', 'a file' if path.exists() else 'no such folder', _EXPECTED)
    files = sorted(p for p in path.iterdir() if p.suffix in ('.mcap', '.db3'))
    if not files:
        raise InvalidInput('bag', 'a folder without such files', _EXPECTED)
    for file in files:
        if file.with_name(f'{file.name}-journal').exists():
            # Opening the file makes SQLite roll back what was not committed.
            with contextlib.closing(sqlite3.connect(file)) as database:
                database.execute('SELECT count(*) FROM messages').fetchone()
    return files


def _read_truncated_mcap(file: Path, found: _Contents) -> None:
    """Read an MCAP file up to its last complete record."""
    schemas: dict[int, str] = {}
    topics: dict[int, str] = {}
    messages: list[tuple[int, str, bytes]] = []
    for record in _complete_records(file.read_bytes()):
        if isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel):
            topics[record.id] = record.topic
            found.add_topic(record.topic, schemas[record.schema_id])
        elif isinstance(record, Message):
            messages.append((record.log_time, topics[record.channel_id], record.data))
    for time, topic, data in sorted(messages, key=operator.itemgetter(0)):  # as rosbags does
        found.add_message(topic, time, data)


def _complete_records(data: bytes) -> Iterator[McapRecord]:
    """Yield the complete records of an MCAP file, with those in its chunks.

    The file of a killed recorder has no summary, and may end within a record.
    """
    stream = io.BytesIO(data)
    try:
        yield from StreamReader(stream, validate_crcs=True).records
    except (EndOfFile, struct.error, UnicodeDecodeError):  # raised for an incomplete record
        if stream.tell() < len(data):  # not at the end: the file is damaged, not truncated
            raise
