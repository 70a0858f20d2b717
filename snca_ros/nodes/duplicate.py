"""(ROS) Whether another node answers for the same voxel already."""

import time

from sensor_msgs.msg import JointState

from sim_node.errors import InvalidInput
from sim_node.ros.node_base import RosNode
from sim_node.ros.sim_interface import ACTUATION
from sim_node.ros.topics import actuation_format, read_joint_state, stream_qos

_TELL_LIMIT = 1.0  # seconds after which a double that was seen has been heard, if it answers


class Double:
    """A node of the same voxel elsewhere, started by mistake or by somebody hostile.

    Two of them would say different things. So whoever comes second holds itself back until the
    first is gone. Processes that were killed are not seen by those that start after them.

    Args:
        node: the one that asks, before it publishes.
        voxel: its name; both would answer with its actuation.
    """

    def __init__(self, node: RosNode, voxel: str) -> None:
        self._node, self._topic = node, ACTUATION.of(voxel)
        self._wire = actuation_format(voxel)
        self._heard = b''  # the episode in which it was heard last
        self._since = time.monotonic()
        self._subscription = node.create_subscription(
            JointState, self._topic, self._note, stream_qos(1), raw=True
        )

    def _note(self, data: bytes) -> None:
        try:
            self._heard, *_ = read_joint_state(self._wire, data, -1.0, 1.0)
        except InvalidInput as error:
            self._node.refuse(self._topic, error)

    def answers(self, episode: bytes) -> bool:
        """Tell whether there is one that answers in this episode, or may be heard yet."""
        there = self._node.count_publishers(self._topic) > 1
        young = time.monotonic() - self._since < _TELL_LIMIT
        return there and (self._heard == episode or young)

    def close(self) -> None:
        """Stop listening."""
        self._node.destroy_subscription(self._subscription)
