"""(ROS) The simulations in a robot's namespace: each announces itself, and nodes find the others.

The name of the topic of an announcement contains the identity of the simulation, so that the graph
shows which simulations exist, whatever other nodes publish on the robot's topics.
"""

import os
import platform
import time

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.subscription import Subscription
from std_msgs.msg import String

from sim_node.episode import new_identity
from sim_node.errors import InvalidInput
from sim_node.ros.node_base import RosNode
from sim_node.ros.sim_interface import PRESENCE
from sim_node.ros.strangers import nodes_that_publish

_PERIOD = 0.5  # seconds between two announcements
_LOOK = 0.3  # seconds for which a new node looks for other simulations
_ENDING = 4.0  # seconds that another simulation may take to end, more than _SILENCE
_SILENCE = 3.0  # seconds without an announcement after which a simulation counts as killed
_STARTING, _RUNNING = 'starting', 'running'
_LAST = QoSProfile(
    depth=1, reliability=ReliabilityPolicy.RELIABLE, durability=DurabilityPolicy.TRANSIENT_LOCAL
)


class _Listener:
    """Listens to the announcements of one simulation."""

    def __init__(self, node: Node, identity: str) -> None:
        self.text = ''
        self._heard = time.monotonic()
        self.subscription: Subscription = node.create_subscription(
            String, _topic(identity), self._note, _LAST
        )

    def _note(self, message: String) -> None:
        self.text, self._heard = message.data, time.monotonic()

    @property
    def is_silent(self) -> bool:
        """Return whether nothing has been heard for `_SILENCE`."""
        return time.monotonic() - self._heard > _SILENCE


class Simulations:
    """The simulations in the namespace of a node.

    A simulation that was killed exists until its participant's lease ends (20 s by default); one
    that is new to a node has not been discovered at all if it was killed before.

    Args:
        node: looks for them.
        own: identity of the node's own simulation, which does not count; empty if it has none.
    """

    def __init__(self, node: Node, own: str = '') -> None:
        self._node, self._own = node, own
        self._listeners: dict[str, _Listener] = {}
        self._prefix = node.resolve_topic_name(_topic(''))

    def is_live(self, identity: str) -> bool:
        """Return whether a simulation exists."""
        exists = self._node.count_publishers(self._prefix + identity) > 0
        if not exists:
            self._stop_listening(identity)
        return exists

    def is_silent(self, identity: str) -> bool:
        """Return whether a simulation that exists has not announced itself for three seconds.

        The node listens to its announcements from the first call on.
        """
        return self._listen(identity).is_silent

    def others(self) -> list[str]:
        """Return the identities of all simulations that exist but the node's own."""
        found = [
            name.removeprefix(self._prefix)
            for name, _ in self._node.get_topic_names_and_types()
            if name.startswith(self._prefix) and self._node.count_publishers(name)
        ]
        for gone in self._listeners.keys() - set(found):
            self._stop_listening(gone)
        return [identity for identity in found if identity != self._own]

    def with_precedence(self) -> str:
        """Return who the simulation is that goes on instead of the node's own; empty for none.

        It is one that has begun, or, of several that start at once, the one with the smallest
        identity. One that has not been heard yet may have begun.
        """
        for identity in self.others():
            listener = self._listen(identity)
            starts = listener.text.endswith(_STARTING)
            yields = self._own and starts and self._own < identity
            if not yields and not listener.is_silent:
                nodes = ', '.join(nodes_that_publish(self._node, self._prefix + identity))
                process = listener.text.partition(' ')[0]
                return f'{nodes} ({process})' if process else nodes
        return ''

    def _listen(self, identity: str) -> _Listener:
        if identity not in self._listeners:
            self._listeners[identity] = _Listener(self._node, identity)
        return self._listeners[identity]

    def _stop_listening(self, identity: str) -> None:
        if identity in self._listeners:
            self._node.destroy_subscription(self._listeners.pop(identity).subscription)


def _topic(identity: str) -> str:
    return PRESENCE.name.replace('*', identity)


class Announcement:
    """Announces the simulation of a node, and finds out whether it is the only one.

    Args:
        node: node of the simulation.

    Attributes:
        identity: of the simulation.
        alone: whether this is the only simulation, as was found out at its start.
    """

    def __init__(self, node: RosNode) -> None:
        self.identity, self.alone = new_identity(), False
        self._publisher = node.create_publisher(String, _topic(self.identity), _LAST)
        self._others = Simulations(node, self.identity)
        self._looks_since: float | None = None
        self._alone_since = 0.0
        node.create_timer(_PERIOD, self._publish)
        self._publish()

    def may_begin(self) -> bool:
        """Return whether this is the only simulation; from then on it has precedence over others.

        Raises:
            InvalidInput: another simulation has precedence, and does not end.
        """
        now = time.monotonic()
        if self._looks_since is None:  # messages arrive from now on
            self._looks_since = self._alone_since = now
        if self.alone:
            return True
        if other := self._others.with_precedence():
            if now - self._alone_since > _ENDING:
                namespace = self._publisher.topic_name.rpartition('/')[0] or '/'
                raise InvalidInput(
                    'namespace', namespace, f'one without a simulation: {other} simulates there'
                )
            return False
        self._alone_since, self.alone = now, now - self._looks_since > _LOOK
        if self.alone:
            self._publish()
        return self.alone

    def _publish(self) -> None:
        process = f'{platform.node()}:{os.getpid()}'
        self._publisher.publish(String(data=f'{process} {_RUNNING if self.alone else _STARTING}'))
