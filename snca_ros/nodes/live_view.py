"""(ROS) The node of `snca walk --view`: sends frames with the state of a robot to a web page."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.subscription import Subscription
from sensor_msgs.msg import Image, JointState
from visualization_msgs.msg import MarkerArray

from sim_node.control_time import step_of_stamp
from sim_node.ros import topics
from sim_node.ros.interface import DIAGNOSTICS
from sim_node.ros.node_base import RosNode, take_all
from sim_node.ros.sim_interface import ACTUATION, APPLIED, MARKERS, ODOMETRY, RELIABLE, SENSORS
from snca_ros.cell.coding import pack_trains
from snca_ros.nodes.cell_messages import CellMessages, topic_name
from snca_ros.nodes.interfaces import VIEW_NODE, VIEW_RATE
from snca_ros.recording.gait import area_ratios, readings_of
from snca_ros.trained_controller import TrainedController

PERIOD = 1.0 / VIEW_RATE
"""Seconds of wall time between frames."""

_DIGITS = 4  # of the numbers sent


class ViewNode(RosNode):
    """Subscribes to all topics of a robot and passes frames on, 30 per second of wall time.

    Args:
        robot: namespace of the robot.
        trained: its controller.
        send: called with each frame, ready for JSON: `step`, `x`, `y` [m], `corners` [m] of the
            newest pose, `area`, `touch` and applied `actuation` of each voxel, `messages`, rows of
            step, voxel and numbers sent, `ages`, rows of step and the age of each voxel's answer
            as in `applied_actuation`, and `health`, level and text of each node by its name.
        reliability: of the links, see `topics.link_qos`.
    """

    def __init__(
        self, robot: str, trained: TrainedController, send: Callable[[dict[str, Any]], None],
        reliability: str = RELIABLE,
    ) -> None:
        super().__init__(VIEW_NODE.name, namespace=f'/{robot}', enable_rosout=False)
        self._send = send
        voxels, qos = trained.morphology.voxel_names, topics.stream_qos()
        of_links = topics.link_qos(reliability)
        self._names = trained.architecture.sensors
        self._voxels = voxels
        topic = topic_name(trained.architecture)
        self._odometry_wire = topics.odometry_format(trained.morphology.grid_string)
        self._robot = topics.RobotMarkers(len(voxels))
        self._sensors = [
            topics.sensors_format(voxel, self._names) for voxel in voxels
        ]
        self._actuation = [topics.actuation_format(voxel) for voxel in voxels]
        self._messages = [CellMessages(trained.architecture, voxel) for voxel in voxels]
        self._odometry_box = self.create_mailbox(Odometry, ODOMETRY.name, qos)
        self._applied_wire = topics.applied_format(robot, voxels)
        self._applied_box = self.create_mailbox(JointState, APPLIED.name, qos)
        self._markers_box = self.create_mailbox(MarkerArray, MARKERS.name, qos)
        self._boxes = {
            kind: [self.create_mailbox(of_type, f'{voxel}/{name}', of_links) for voxel in voxels]
            for kind, of_type, name in (
                ('sensors', JointState, SENSORS.name),
                ('actuation', JointState, ACTUATION.name),
                ('messages', Image, topic),
            )
        }
        self._spiking = trained.architecture.spiking
        self._frame: dict[str, Any] = {
            'area': [None] * len(voxels), 'touch': [None] * len(voxels),
            'actuation': [None] * len(voxels), 'health': {},
        }
        self._killed: set[str] = set()
        self.create_subscription(DiagnosticArray, DIAGNOSTICS.name, self._note_health, 100)
        self.create_timer(PERIOD, self._send_frame)

    def _note_health(self, message: DiagnosticArray) -> None:
        prefix = self.get_namespace() + '/'
        for status in message.status:
            node = status.name.removeprefix(prefix)
            if status.name.startswith(prefix) and node not in self._killed:
                level = int.from_bytes(status.level, 'little')
                self._frame['health'][node] = level, status.message

    def note_killed(self, node: str) -> None:
        """Show a node as killed, and ignore its diagnostics that are still to arrive."""
        self._killed.add(node)
        self._frame['health'][node] = 2, 'killed'

    def note_started(self, node: str) -> None:
        """Show a restarted node as starting, until its first diagnostics arrive."""
        self._killed.discard(node)
        self._frame['health'][node] = 2, 'starting'

    def _send_frame(self) -> None:
        """Send a frame with what has arrived since the last one."""
        frame, sent = self._frame, []
        for step, x, y in self._read('odometry', self._odometry_box, self._position):
            frame['step'], frame['x'], frame['y'] = step, x, y
        frame['ages'] = []
        for step, applied, ages in self._read('applied', self._applied_box, self._applied):
            frame['actuation'] = applied
            frame['ages'].append([step, ages])
        for data in take_all(self._markers_box):
            corners = self._robot.decode(data)
            if corners is not None:
                frame['corners'] = corners.round(_DIGITS).ravel().tolist()
        for i, (sensors, actuation, messages) in enumerate(zip(*self._boxes.values(), strict=True)):
            voxel = self._voxels[i]
            for readings in self._read(f'{voxel}/sensors', sensors, partial(self._readings, i)):
                frame['area'][i], frame['touch'][i] = self._shown(readings)
            self._read(f'{voxel}/actuation', actuation, partial(self._action, i))  # checked only
            sent += self._read(f'{voxel}/messages', messages, partial(self._cell_message, i))
        if 'step' in frame and 'corners' in frame:
            self._send({**frame, 'messages': sent})

    def _shown(self, readings: np.ndarray) -> list[float | None]:
        """Return area ratio and touch of a voxel from its readings; None where it has no sensor."""
        numbers = (area_ratios(readings, self._names), readings_of('touch', readings, self._names))
        return [round(float(n), _DIGITS) if np.isfinite(n) else None for n in numbers]

    def _read(
        self, topic: str, mailbox: Subscription, read: Callable[[bytes], Any]
    ) -> list[Any]:
        """Return the messages that have arrived, decoded by `read`; refuse those that it cannot."""
        found = []
        for data in take_all(mailbox):
            try:
                found.append(read(data))
            except Exception as error:  # rclpy raises various ones for bytes of another layout
                self.refuse(topic, error)
        return found

    def _position(self, data: bytes) -> tuple[int, float, float]:
        stamp, (position,) = self._odometry_wire.decode(data, 'position')
        return step_of_stamp(*stamp), float(position[0]), float(position[2])

    def _readings(self, i: int, data: bytes) -> np.ndarray:
        return topics.read_joint_state(self._sensors[i], data, 0.0, 1.0)[2]

    def _applied(self, data: bytes) -> tuple[int, list[float], list[int]]:
        """Return step, actuation and ages of all voxels."""
        stamp, (applied, ages) = self._applied_wire.decode(data, 'position', 'effort')
        return step_of_stamp(*stamp), applied.round(_DIGITS).tolist(), ages.astype(int).tolist()

    def _action(self, i: int, data: bytes) -> float:
        return float(topics.read_joint_state(self._actuation[i], data, -1.0, 1.0)[2][0])

    def _cell_message(self, i: int, data: bytes) -> list[Any]:
        """Return step, voxel, and a number per channel: a spike train as an integer, or a value."""
        _, step, message = self._messages[i].decode(data)
        rows = message.reshape(-1, message.shape[-1])
        if not self._spiking:
            return [step, i, rows.ravel().tolist()]
        return [step, i, pack_trains(rows).astype(int).tolist()]
