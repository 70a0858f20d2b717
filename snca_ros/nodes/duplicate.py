"""(ROS) Detects another node that publishes the actuation of the same voxel."""

from sensor_msgs.msg import JointState

from sim_node.errors import InvalidInput
from sim_node.ros.node_base import RosNode
from sim_node.ros.sim_interface import ACTUATION
from sim_node.ros.topics import actuation_format, link_qos, read_joint_state

_LISTENING_TIME = 1.0  # seconds within which a message of an active duplicate arrives


class DuplicateDetector:
    """Detects another node of the same voxel, started by mistake or by an attacker.

    Two nodes of a voxel would publish different actuation. So the node that starts second does
    not publish until the first is gone. DDS does not report processes that were killed before this
    one started.

    Args:
        node: node of the voxel, which does not publish messages yet.
        voxel: name of the voxel.
        reliability: of the links, see `link_qos`.
    """

    def __init__(self, node: RosNode, voxel: str, reliability: str) -> None:
        self._node, self._topic = node, ACTUATION.of(voxel)
        self._wire = actuation_format(voxel)
        self._episode = b''  # of the duplicate's last message
        self._since = node.listening.now()
        self._subscription = node.create_subscription(
            JointState, self._topic, self._note, link_qos(reliability, 1), raw=True
        )

    def _note(self, data: bytes) -> None:
        try:
            self._episode, *_ = read_joint_state(self._wire, data, -1.0, 1.0)
        except InvalidInput as error:
            self._node.refuse(self._topic, error)

    def is_active(self, episode: bytes) -> bool:
        """Return whether a duplicate publishes in this episode, or exists and may still do so."""
        exists = self._node.count_publishers(self._subscription.topic_name) > 1
        waiting = self._node.listening.now() - self._since < _LISTENING_TIME
        return exists and (self._episode == episode or waiting)

    def close(self) -> None:
        """Destroy the subscription to the voxel's actuation."""
        self._node.destroy_subscription(self._subscription)
