"""(ROS) The recorder node: writes every message of the robot's graph into a rosbag2 bag.

It flushes the file every half second, so a kill loses at most the messages of half a second. When
the disk is nearly full it closes the bag and ends.
"""

import contextlib
import time
from collections.abc import Iterator
from datetime import datetime
from functools import partial
from pathlib import Path

from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.topic_endpoint_info import TopicEndpointInfo
from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.storage_mcap import McapWriter
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Writer

from sim_node.ros.declared_parameters import check_unknown_parameters, declare
from sim_node.ros.node_base import RosNode, run_nodes
from sim_node.ros.sim_interface import CLOCK, MARKERS
from sim_node.ros.strangers import Strangers
from sim_node.ros.topics import link_qos, stream_qos
from snca_ros.files import BAGS, RESERVE, check_new_bag, room_for
from snca_ros.nodes.interfaces import LINKS, RECORDER, RECORDER_NODE, RecorderOptions
from snca_ros.nodes.message_definitions import MessageDefinitions, message_class
from snca_ros.recording.streams import KINDS

GLOBAL_TOPICS = tuple(t.name for t in RECORDER_NODE.subscribes if t.name.startswith('/'))

_TYPES = {
    **{kind: reader.type for kind, reader in KINDS.items()},
    MARKERS.name: MARKERS.type,
}
_LINKS = {topic.name for topic in LINKS}
_QUEUE = 20_000  # messages of one topic that can wait while the disk is slow
_DISCOVERY_PERIOD = 0.1  # seconds between checks for new topics, while a graph starts
_SETTLED_PERIOD = 1.0  # the same after _SETTLED seconds without a new topic
_SETTLED = 10.0
_FLUSH_PERIOD = 0.5  # seconds
_DRAINED = 0.3  # seconds without a message after which the queues count as empty
_FAILED = 1


class RecorderNode(RosNode):
    """Records all topics of its namespace, and /clock, /diagnostics and /rosout."""

    def __init__(self) -> None:
        super().__init__(RECORDER_NODE.name)
        new = RecorderOptions(f'{BAGS}/{datetime.now():%Y%m%d-%H%M%S}')
        options = declare(self, RECORDER, new)
        check_unknown_parameters(self)
        self._reliability = options.reliability
        self._definitions = MessageDefinitions()
        self._strangers = Strangers(self, self.get_logger().warning, restarted=True)
        self._topics: set[str] = set()
        self._unrecorded: dict[str, str] = {}  # their types
        self._last_message = 0.0
        # Receipt times never go back, also if the clock of the machine is set while it records.
        self._clock_offset = time.time_ns() - time.monotonic_ns()
        self._writer = self._open(Path(options.bag), options.storage)
        self._newest_topic = time.monotonic()
        self._discovery_timer = self.create_timer(_DISCOVERY_PERIOD, self._discover_topics)
        self.create_timer(_FLUSH_PERIOD, self._flush)

    def _open(self, path: Path, storage: str) -> Writer:
        check_new_bag(path, storage)
        plugin = StoragePlugin[storage.upper()]
        writer = Writer(path, version=Writer.VERSION_LATEST, storage_plugin=plugin)
        writer.open()
        self.get_logger().info(f'recording into {path}')
        return writer

    def _discover_topics(self) -> None:
        prefix = self.get_namespace().rstrip('/') + '/'
        for topic, types in self.get_topic_names_and_types():
            # Topics with a token that begins with _ are hidden; rosbag2 does not record them.
            of_robot = topic.startswith(prefix) and '/_' not in topic
            known = topic in self._topics or topic in self._unrecorded
            if (of_robot or topic in GLOBAL_TOPICS) and not known:
                self._record(topic, _declared_type(topic) or types[0])
        settled = self._topics and time.monotonic() - self._newest_topic > _SETTLED
        period = _SETTLED_PERIOD if settled else _DISCOVERY_PERIOD
        self._discovery_timer.timer_period_ns = int(period * 1e9)

    def _record(self, topic: str, message_type: str) -> None:
        publishers = [
            publisher for publisher in self.get_publishers_info_by_topic(topic)
            if publisher.topic_type == message_type
        ]
        if not publishers or not self._is_of_robot(topic, publishers):
            return
        self._newest_topic = time.monotonic()
        # Other nodes may publish anything: none of it must end the recorder.
        try:
            subscribe = partial(self.create_subscription, message_class(message_type), topic)
            text, digest = self._definitions.of(message_type, str(publishers[0].topic_type_hash))
            connection = self._writer.add_connection(
                topic, message_type, msgdef=text, rihs01=digest,
                offered_qos_profiles=[_offered_qos(publisher) for publisher in publishers],
            )
            subscribe(partial(self._write, connection), self._qos(topic, publishers), raw=True)
        except Exception as error:
            self._unrecorded[topic] = message_type
            reason = ' '.join(str(error).split())
            self.get_logger().error(f'{topic} ({message_type}) is not recorded: {reason}')
        else:
            self._topics.add(topic)

    def _qos(self, topic: str, publishers: list[TopicEndpointInfo]) -> QoSProfile:
        """Return the QoS of the subscription to a topic."""
        if topic.rpartition('/')[2] in _LINKS:
            return link_qos(self._reliability, _QUEUE)
        return stream_qos(_QUEUE) if _declared_type(topic) else _compatible_qos(publishers)

    def _is_of_robot(self, topic: str, publishers: list[TopicEndpointInfo]) -> bool:
        """Return whether /clock is this robot's one; true for all other topics."""
        own = self.get_namespace()
        return topic != CLOCK.name or any(p.node_namespace == own for p in publishers)

    def _write(self, connection: Connection, data: bytes) -> None:
        self._last_message = self.listening.now()
        if self.exit_code is None:
            with self._ending_on_error('written'):
                now = self._clock_offset + time.monotonic_ns()
                self._writer.write(connection, now, data)
                self.count('messages')

    def _flush(self) -> None:
        """Flush the bag to the file system; end the node if there is little space left."""
        storage = self._writer.storage
        if self.exit_code is not None or storage is None:
            return
        with self._ending_on_error('written'):
            flush(self._writer)
            room = room_for(storage.path)
            if room < RESERVE:
                raise OSError(f'only {room / 1e6:.1f} MB left on the disk or up to the size limit')

    @contextlib.contextmanager
    def _ending_on_error(self, what: str) -> Iterator[None]:
        try:
            yield
        except Exception as error:  # whatever a storage raises
            self.get_logger().error(f'{self._writer.path}: cannot be {what}: {error}')
            self.exit_code = _FAILED

    def draining(self) -> bool:
        """Return whether messages still arrive, so that the queues are empty at the end."""
        return self.listening.now() - self._last_message < _DRAINED

    def close(self) -> None:
        """Finish the bag."""
        with self._ending_on_error('finished'):
            self._writer.close()
            written = self.counters.get('messages', 0)
            self.get_logger().info(f'{self._writer.path}: {written} messages')

    def health(self) -> tuple[bytes, str]:
        """Return level and text for /diagnostics: what is recorded, and what is wrong."""
        text = f'recording {len(self._topics)} topics'
        missing = ', '.join(f'{name} ({kind})' for name, kind in self._unrecorded.items())
        crowded = self._strangers.text(t for t in self._topics if _declared_type(t))
        wrong = [part for part in (missing and f'not recorded: {missing}', crowded) if part]
        level = DiagnosticStatus.WARN if wrong else DiagnosticStatus.OK
        return level, '; '.join([text, *wrong])

    def statistics(self) -> dict[str, int]:
        """Return the number of topics that cannot be recorded, for /diagnostics."""
        return {'topics not recorded': len(self._unrecorded)} if self._unrecorded else {}


def flush(writer: Writer) -> None:
    """Flush an open bag to the file system, so that readers can read all messages written."""
    storage = writer.storage
    if isinstance(storage, Sqlite3Writer):
        storage.conn.commit()
    elif isinstance(storage, McapWriter) and storage.chunk.bio.tell():
        storage.close_chunk()
        storage.bio.flush()


def _declared_type(topic: str) -> str | None:
    """Return the type of a topic of the robot's own nodes; None for other topics.

    Such a topic is recorded with this type and the robot's QoS, whatever other nodes offer on it.
    """
    return _TYPES.get(topic.rpartition('/')[2])


def _compatible_qos(publishers: list[TopicEndpointInfo]) -> QoSProfile:
    """Return the QoS of a subscription that is compatible with all of these publishers."""
    offered = [publisher.qos_profile for publisher in publishers]
    reliable = all(q.reliability == ReliabilityPolicy.RELIABLE for q in offered)
    transient = all(q.durability == DurabilityPolicy.TRANSIENT_LOCAL for q in offered)
    return QoSProfile(
        depth=_QUEUE,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=(
            DurabilityPolicy.TRANSIENT_LOCAL if transient else DurabilityPolicy.VOLATILE
        ),
    )


def _offered_qos(publisher: TopicEndpointInfo) -> Qos:
    """Return a publisher's QoS as rosbags stores it."""
    qos = publisher.qos_profile

    def seconds(duration) -> QosTime:
        return QosTime(*divmod(duration.nanoseconds, 10**9))

    return Qos(
        history=QosHistory[qos.history.name],
        depth=qos.depth,
        reliability=QosReliability[qos.reliability.name],
        durability=QosDurability[qos.durability.name],
        deadline=seconds(qos.deadline),
        lifespan=seconds(qos.lifespan),
        liveliness=QosLiveliness[qos.liveliness.name],
        liveliness_lease_duration=seconds(qos.liveliness_lease_duration),
        avoid_ros_namespace_conventions=qos.avoid_ros_namespace_conventions,
    )


def main(argv: list[str]) -> int:
    """Run the recorder node; return the exit code."""
    return run_nodes(lambda: [RecorderNode()], argv)
