"""Reads the serialised messages of a rosbag2 folder, also of one that was not closed."""

import contextlib
import io
import sqlite3
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import quote

import numpy as np
import yaml
from mcap.exceptions import EndOfFile
from mcap.records import Channel, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader
from rosbags.rosbag2 import Reader

from sim_node.errors import InvalidInput
from snca_ros.files import NOT_IN_SQLITE

_EXPECTED = 'a rosbag2 folder with metadata.yaml and .mcap or .db3 files'


@dataclass(frozen=True, eq=False)
class Topic:
    """One topic of a bag, with its messages in the order in which they were recorded.

    Attributes:
        type: message type, such as 'sensor_msgs/msg/JointState'; if the bag has several types for
            this topic, the one of most messages.
        times: (n,) wall time at which each message was recorded [ns]. Clocks can be set back.
        order: (n,) place of each message among all messages of the bag, increasing.
        messages: n serialised messages.
        foreign: number of messages of other types.
    """

    type: str
    times: np.ndarray
    order: np.ndarray
    messages: list[bytes]
    foreign: int = 0


class _Contents:
    """The messages read so far, by topic and type: order, times [ns] and messages."""

    def __init__(self) -> None:
        self._found: dict[tuple[str, str], tuple[list[int], list[int], list[bytes]]] = {}
        self._n_messages = 0

    def add_topic(self, name: str, kind: str) -> None:
        """Add a topic unless it is known."""
        self._found.setdefault((name, kind), ([], [], []))

    def add_message(self, name: str, kind: str, time: int, data: bytes) -> None:
        """Add the next message."""
        order, times, messages = self._found.setdefault((name, kind), ([], [], []))
        order.append(self._n_messages)
        times.append(time)
        messages.append(data)
        self._n_messages += 1

    def topics(self) -> dict[str, Topic]:
        """Return the topics by name."""
        counts: dict[str, dict[str, int]] = {}
        for (name, kind), (order, *_) in self._found.items():
            counts.setdefault(name, {})[kind] = len(order)
        out = {}
        for name, by_type in counts.items():
            kind = max(by_type, key=by_type.__getitem__)
            order, times, messages = self._found[name, kind]
            out[name] = Topic(
                kind, np.array(times, dtype=np.int64), np.array(order, dtype=np.int64), messages,
                sum(by_type.values()) - len(order),
            )
        return out


def read_storage(path: Path) -> tuple[dict[str, Topic], bool]:
    """Return the topics of the bag at `path`, and whether its recorder closed it.

    Raises:
        InvalidInput: there is no bag, or it cannot be read; the text names it and the reason.
    """
    closed = (path / 'metadata.yaml').exists()
    found = _Contents()
    try:
        files = _files_of_closed_bag(path, found) if closed else _files_of_unclosed_bag(path)
        for file in files:
            (_read_mcap if file.suffix == '.mcap' else _read_sqlite)(file, found)
    except InvalidInput as error:
        raise error.found_in(str(path)) from None
    except Exception as error:  # rosbags, mcap and sqlite3 raise various ones for a damaged file
        reason = str(error) or type(error).__name__
        raise InvalidInput('bag', ' '.join(reason.split()), _EXPECTED, str(path)) from None
    return found.topics(), closed


def _files_of_closed_bag(path: Path, found: _Contents) -> list[Path]:
    """Return the files of a closed bag, after a check of its metadata; add all of its topics.

    `rosbags` reads messages in the order of their times. We read the files, in the order in which
    they were written, unless the bag is compressed: then this adds its messages, and returns none.
    """
    metadata = yaml.safe_load((path / 'metadata.yaml').read_text(encoding='utf-8'))
    names = metadata['rosbag2_bagfile_information']['relative_file_paths']
    files = [path / Path(name).name for name in names]
    if any(NOT_IN_SQLITE.intersection(str(file.absolute())) for file in files):
        return files  # rosbags would take such a path of an sqlite3 file for another one
    with Reader(path) as reader:
        for connection in reader.connections:
            found.add_topic(connection.topic, connection.msgtype)
        if reader.compression_mode:
            for connection, time, data in reader.messages():
                found.add_message(connection.topic, connection.msgtype, time, bytes(data))
            return []
    return files


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


def _read_sqlite(file: Path, found: _Contents) -> None:
    """Read an sqlite3 file."""
    address = f'file:{quote(str(file))}?immutable=1'
    with contextlib.closing(sqlite3.connect(address, uri=True)) as database:
        for name, kind in database.execute('SELECT name, type FROM topics'):
            found.add_topic(name, kind)
        for row in database.execute(
            'SELECT topics.name, topics.type, messages.timestamp, messages.data '
            'FROM messages JOIN topics ON messages.topic_id = topics.id ORDER BY messages.id'
        ):
            found.add_message(*row)


def _read_mcap(file: Path, found: _Contents) -> None:
    """Read an MCAP file up to its last complete record."""
    schemas: dict[int, str] = {}
    topics: dict[int, tuple[str, str]] = {}
    for record in _complete_records(file.read_bytes()):
        if isinstance(record, Schema):
            schemas[record.id] = record.name
        elif isinstance(record, Channel):
            topics[record.id] = record.topic, schemas[record.schema_id]
            found.add_topic(*topics[record.id])
        elif isinstance(record, Message):
            found.add_message(*topics[record.channel_id], record.log_time, record.data)


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
