"""Reads the last diagnostics of each node of a recorded graph from /diagnostics."""

import contextlib
import functools
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from rosbags.typesys import Stores, get_typestore

from sim_node.errors import InvalidInput
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


def read_health(topics: Mapping[str, Topic], robot: str) -> dict[str, NodeHealth]:
    """Return the last diagnostics of each node of a robot, by its name without the namespace.

    Raises:
        InvalidInput: a message on /diagnostics is no DiagnosticArray.
    """
    by_process: dict[str, dict[str, dict[str, float]]] = {}  # node: process: values
    try:
        for data in topics[TOPIC].messages if TOPIC in topics else ():
            for status in _types().deserialize_cdr(data, _TYPE).status:
                robot_of, _, node = status.name.rpartition('/')
                if robot_of == f'/{robot}':
                    by_process.setdefault(node, {})[status.hardware_id] = _numbers(status)
    except Exception as error:  # rosbags raises various ones for bytes of another layout
        raise InvalidInput(TOPIC, ' '.join(str(error).split()), _TYPE) from None
    return {node: _merge(list(found.values())) for node, found in by_process.items()}


@functools.cache
def _types():
    return get_typestore(Stores.ROS2_JAZZY)


def _numbers(status: Any) -> dict[str, float]:
    numbers = {}
    for pair in status.values:
        with contextlib.suppress(ValueError):  # nodes of others may publish texts
            numbers[pair.key] = float(pair.value)
    return numbers


def _merge(processes: list[dict[str, float]]) -> NodeHealth:
    counts = {key for values in processes for key in values if not key.endswith(_MEASURED)}
    totals = {key: sum(values.get(key, 0.0) for values in processes) for key in sorted(counts)}
    return NodeHealth(len(processes), {**processes[-1], **totals})
