"""What the nodes of a recorded graph said of themselves in /diagnostics."""

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
_MEASURED = ('per second', '[ms]')  # ends of the names of figures that are no counts


@dataclass(frozen=True)
class NodeHealth:
    """What a node published last in its diagnostics.

    Attributes:
        lives: how many processes it was, one after the other.
        figures: numbers by name; counts are those of all lives, others of the last one. What a
            life did after its last message, up to a second, is not in them.
    """

    lives: int
    figures: Mapping[str, float]

    @property
    def links(self) -> dict[str, tuple[int, ...]]:
        """Return messages on time, late and lost by the topic that the node listens to."""
        topics = [key[: -len(' on time')] for key in self.figures if key.endswith(' on time')]
        return {
            topic: tuple(int(self.figures.get(f'{topic} {outcome}', 0)) for outcome in OUTCOMES)
            for topic in topics
        }


def read_health(topics: Mapping[str, Topic], robot: str) -> dict[str, NodeHealth]:
    """Return what is known of each node of a robot, by its name without the namespace.

    Raises:
        InvalidInput: a message is not of the type that it should be.
    """
    lives: dict[str, dict[str, dict[str, float]]] = {}  # by node and process
    try:
        for data in topics[TOPIC].messages if TOPIC in topics else ():
            for status in _types().deserialize_cdr(data, _TYPE).status:
                robot_of, _, node = status.name.rpartition('/')
                if robot_of == f'/{robot}':
                    lives.setdefault(node, {})[status.hardware_id] = _figures(status)
    except Exception as error:  # what rosbags says about bytes of another layout
        raise InvalidInput(TOPIC, ' '.join(str(error).split()), _TYPE) from None
    return {node: _sum(list(mine.values())) for node, mine in lives.items()}


@functools.cache
def _types():
    return get_typestore(Stores.ROS2_JAZZY)


def _figures(status: Any) -> dict[str, float]:
    figures = {}
    for pair in status.values:
        with contextlib.suppress(ValueError):  # another node's words, not a number
            figures[pair.key] = float(pair.value)
    return figures


def _sum(lives: list[dict[str, float]]) -> NodeHealth:
    counted = {key for life in lives for key in life if not key.endswith(_MEASURED)}
    totals = {key: sum(life.get(key, 0.0) for life in lives) for key in sorted(counted)}
    return NodeHealth(len(lives), {**lives[-1], **totals})
