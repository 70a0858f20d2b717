"""(ROS) Nodes that publish on a robot's topics besides the node that should."""

from collections.abc import Callable, Iterable, Mapping

from rclpy.node import Node
from rclpy.publisher import Publisher


def nodes_that_publish(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes of all publishers of a topic, sorted.

    Args:
        node: asks the graph.
        topic: full name of the topic, after remapping.
    """
    found = node.get_publishers_info_by_topic(topic)
    return sorted(f'{i.node_namespace.rstrip("/")}/{i.node_name}' for i in found)


class Strangers:
    """Finds nodes that publish on topics which only one node should publish.

    Args:
        node: the node that should.
        warn: called with one line of text for each node that is found.
    """

    def __init__(self, node: Node, warn: Callable[[str], object]) -> None:
        self._node, self._warn = node, warn
        self._known: set[str] = set()

    def text(self, publishers: Iterable[Publisher]) -> str:
        """Return a text for the diagnostics, empty if there are none; warn of new ones.

        Args:
            publishers: those of the node.
        """
        topics: dict[str, list[str]] = {}
        for publisher in publishers:
            topic = publisher.topic_name
            if self._node.count_publishers(topic) > 1:
                names = nodes_that_publish(self._node, topic)
                if (own := self._node.get_fully_qualified_name()) in names:
                    names.remove(own)
                for name in names:
                    topics.setdefault(name, []).append(topic)
        for name in topics.keys() - self._known:
            self._warn(f'another node publishes on its topics: {shown({name: topics[name]})}')
        self._known = set(topics)
        return f'other nodes publish on its topics: {shown(topics)}' if topics else ''


def shown(topics: Mapping[str, list[str]]) -> str:
    """Return names of nodes, each with the first topic that it publishes."""
    return ', '.join(
        f'{name} ({names[0]}{f" and {len(names) - 1} more" if len(names) > 1 else ""})'
        for name, names in sorted(topics.items())
    )
