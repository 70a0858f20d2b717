"""(ROS) The topic of simulated time: /clock, or the robot's own one if /clock is published."""

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy
from rosgraph_msgs.msg import Clock

from sim_node.ros import topics
from sim_node.ros.sim_interface import CLOCK, OWN_CLOCK


class ClockTopic:
    """Publishes simulated time.

    Args:
        node: node of the simulation.
        name: of the topic; empty for /clock, or `<robot>/clock` if another node publishes /clock.

    Attributes:
        publisher: the publisher, which `settle` may replace.
    """

    def __init__(self, node: Node, name: str) -> None:
        self._node, self._wire = node, topics.clock_format()
        qos = topics.stream_qos()
        self.publisher = node.create_publisher(Clock, name or CLOCK.name, qos)
        self._heard = False
        self._listener = None if name else node.create_subscription(
            Clock, CLOCK.name, self._note, topics.stream_qos(1), raw=True
        )

    def _note(self, data: bytes) -> None:
        self._heard = True

    def settle(self) -> None:
        """Choose the topic before the first message is published.

        Another node has precedence if it has published, if it is no simulation of this project
        (whose publishers are transient-local), or by its name if it starts at the same time.
        """
        if self._listener is None:
            return
        self._node.destroy_subscription(self._listener)
        self._listener = None
        own, topic = self._node.get_fully_qualified_name(), self.publisher.topic_name
        others = {
            f'{i.node_namespace.rstrip("/")}/{i.node_name}': i.qos_profile.durability
            for i in self._node.get_publishers_info_by_topic(topic)
        }
        others.pop(own, None)
        transient = DurabilityPolicy.TRANSIENT_LOCAL
        if others and (
            self._heard or min(others) < own or any(d != transient for d in others.values())
        ):
            self._node.destroy_publisher(self.publisher)
            self.publisher = self._node.create_publisher(Clock, OWN_CLOCK, topics.stream_qos())
            self._node.get_logger().info(
                f'{topic} is published by {", ".join(sorted(others))}: '
                f'the time of this robot is on {self.publisher.topic_name}'
            )

    def publish(self, stamp: tuple[int, int]) -> None:
        """Publish the time of a control step, (seconds, nanoseconds)."""
        self.publisher.publish(self._wire.encode(stamp))
