"""(ROS) The publishers of a voxel: the messages of its cell, and its actuation."""

from collections.abc import Sequence

import numpy as np
from rclpy.node import Node
from rclpy.publisher import Publisher
from sensor_msgs.msg import Image, JointState

from sim_node.control_time import START_STEPS, stamp_of_step
from sim_node.ros import topics
from sim_node.ros.cdr import WireFormat
from sim_node.ros.sim_interface import ACTUATION, BEST_EFFORT
from snca_ros.cell.architecture import Architecture
from snca_ros.nodes.cell_messages import CellMessages, topic_name


class VoxelPublishers:
    """Publishes what a voxel answers.

    The first steps of an episode need every message. Best-effort links may lose it, so the messages
    of these steps are kept and can be repeated.

    Args:
        node: node of the voxel.
        voxel: its name.
        architecture: of its cell.
        reliability: of the links, see `topics.link_qos`.
    """

    def __init__(
        self, node: Node, voxel: str, architecture: Architecture, reliability: str
    ) -> None:
        qos, topic = topics.link_qos(reliability), topic_name(architecture)
        self._messages = CellMessages(architecture, voxel)
        self._actuation = topics.actuation_format(voxel)
        self._to_neighbors = node.create_publisher(Image, f'{voxel}/{topic}', qos)
        self._to_simulation = node.create_publisher(JointState, ACTUATION.of(voxel), qos)
        self._best_effort = reliability == BEST_EFFORT
        self._kept: list[tuple[Publisher, bytes]] = []
        self._episode = b''  # of the kept messages

    @property
    def formats(self) -> Sequence[tuple[Publisher, WireFormat]]:
        """Return the publishers with their formats: of the cell's messages, of the actuation."""
        return [
            (self._to_neighbors, self._messages.format), (self._to_simulation, self._actuation)
        ]

    def keeps(self, step: int) -> bool:
        """Return whether messages of a step must be published here, to be kept."""
        return self._best_effort and step < START_STEPS

    def publish_message(self, episode: bytes, step: int, outbox: np.ndarray) -> None:
        """Publish the cell's message, (n_destinations, n_c, width) spikes or values."""
        name = np.frombuffer(episode, np.uint8)
        data = self._messages.encode(name, stamp_of_step(step), outbox)
        self._publish(episode, step, self._to_neighbors, data)

    def publish_silence(self, episode: bytes, step: int) -> None:
        """Publish a message without spikes, or of zeros."""
        self.publish_message(episode, step, np.zeros(self._messages.shape))

    def publish_actuation(self, episode: bytes, step: int, actuation: float) -> None:
        """Publish the actuation, in [-1, 1]."""
        data = self._actuation.encode(
            stamp_of_step(step), position=np.array([actuation]),
            episode=np.frombuffer(episode, np.uint8),
        )
        self._publish(episode, step, self._to_simulation, data)

    def _publish(self, episode: bytes, step: int, publisher: Publisher, data: bytes) -> None:
        publisher.publish(data)
        if self.keeps(step):
            if episode != self._episode:
                self._episode, self._kept = episode, []
            self._kept.append((publisher, data))

    def repeat(self, episode: bytes, step: int) -> None:
        """Publish the messages of the first steps again.

        Args:
            episode: the present episode.
            step: the present step; after the first ones nothing is repeated.
        """
        if self.keeps(step) and episode == self._episode:
            for publisher, data in self._kept:
                publisher.publish(data)
