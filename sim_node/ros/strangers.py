"""(ROS) Nodes that publish on a robot's topics besides the node that should."""

import time
from collections.abc import Callable, Iterable

from rclpy.node import Node

_LEASE = 30.0  # seconds, more than a killed node stays in the graph


def nodes_that_publish(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes of all publishers of a topic, sorted.

    Args:
        node: asks the graph.
        topic: full name of the topic, after remapping.
    """
    found = node.get_publishers_info_by_topic(topic)
    return sorted(f'{i.node_namespace.rstrip("/")}/{i.node_name}' for i in found)


class Strangers:
    """Finds topics that several nodes publish, although each should have one publisher.

    Args:
        node: asks the graph.
        warn: called with one line of text for each group of nodes that is found.
        restarted: whether nodes of the same name may be one that was killed and its successor; they
            count only when the killed one must have left the graph.
    """

    def __init__(self, node: Node, warn: Callable[[str], object], restarted: bool = False) -> None:
        self._node, self._warn, self._restarted = node, warn, restarted
        self._since: dict[str, float] = {}  # when a group was first seen, by its names [s]
        self._warned: set[str] = set()

    def text(self, topics: Iterable[str]) -> str:
        """Return a text for the diagnostics, empty if there are none; warn of new ones.

        A group counts if it is seen in two calls: at its start a node may change its topics.

        Args:
            topics: full names of topics, after remapping.
        """
        found: dict[str, list[str]] = {}
        for topic in topics:
            if self._node.count_publishers(topic) > 1:
                names = nodes_that_publish(self._node, topic)
                if len(names) > 1:
                    found.setdefault(' and '.join(names), []).append(topic)
        now = time.monotonic()
        known = self._since
        self._since = {group: known.get(group, now) for group in found}
        shown = []
        for group, crowded in found.items():
            same = len(set(group.split(' and '))) == 1
            if group not in known or (same and self._restarted and now - known[group] < _LEASE):
                continue
            more = f' and {len(crowded) - 1} more topics' if len(crowded) > 1 else ''
            shown.append(f'{group} publish {crowded[0]}{more}')
            if group not in self._warned:
                self._warned.add(group)
                self._warn(f'more publishers than one: {shown[-1]}')
        return '; '.join(shown)
