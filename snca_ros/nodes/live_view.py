"""(ROS) The node of `walk --view`: listens to a whole robot and passes on what the page shows."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, JointState
from visualization_msgs.msg import MarkerArray

from sim_node.control_time import step_of_stamp
from sim_node.ros import topics
from sim_node.ros.interface import DIAGNOSTICS
from sim_node.ros.node_base import RosNode
from sim_node.ros.sim_interface import ACTUATION, MARKERS, ODOMETRY, SENSORS
from snca_ros.cell.coding import SNN_STEPS
from snca_ros.controller_file import TrainedController
from snca_ros.nodes.cell_messages import CellMessages, topic_name
from snca_ros.nodes.interfaces import VIEW_NODE, VIEW_RATE
from snca_ros.recording.gait import area_ratios, readings_of

PERIOD = 1.0 / VIEW_RATE
"""Seconds of wall time between frames."""

_DIGITS = 4  # of the numbers sent


class ViewNode(RosNode):
    """Listens to a whole robot and tells a page how it looks, 30 times a second.

    Args:
        robot: its namespace.
        trained: its controller.
        tell: called with each frame, ready for JSON: `step`, `x`, `y` [m], `corners` [m] of the
            newest pose, `area`, `touch` and `actuation` of each voxel, `said`, rows of step,
            voxel and numbers sent, and `health`, level and words of each node by its name.
    """

    def __init__(
        self, robot: str, trained: TrainedController, tell: Callable[[dict[str, Any]], None]
    ) -> None:
        super().__init__(VIEW_NODE.name, namespace=f'/{robot}', enable_rosout=False)
        self._tell = tell
        voxels, qos = trained.morphology.voxel_names, topics.stream_qos()
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
        self._markers_box = self.create_mailbox(MarkerArray, MARKERS.name, qos)
        self._boxes = {
            kind: [self.create_mailbox(of_type, f'{voxel}/{name}', qos) for voxel in voxels]
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
        self.create_timer(PERIOD, self._look)

    def _note_health(self, message: DiagnosticArray) -> None:
        prefix = self.get_namespace() + '/'
        for status in message.status:
            node = status.name.removeprefix(prefix)
            if status.name.startswith(prefix) and node not in self._killed:
                words = int.from_bytes(status.level, 'little'), status.message
                self._frame['health'][node] = words

    def note_killed(self, node: str) -> None:
        """Note that a node was killed: what it has said before, and comes now, is not shown."""
        self._killed.add(node)
        self._frame['health'][node] = 2, 'killed'

    def note_started(self, node: str) -> None:
        """Note that a node was started again: it is starting until it says more."""
        self._killed.discard(node)
        self._frame['health'][node] = 2, 'starting'

    def _look(self) -> None:
        """Tell what has come since the last look."""
        frame, said = self._frame, []
        for step, x, y in self._read('odometry', self._odometry_box, self._placed):
            frame['step'], frame['x'], frame['y'] = step, x, y
        for data in self._markers_box():
            corners = self._robot.decode(data)
            if corners is not None:
                frame['corners'] = corners.round(_DIGITS).ravel().tolist()
        for i, (sensors, actuation, messages) in enumerate(zip(*self._boxes.values(), strict=True)):
            voxel = self._voxels[i]
            for readings in self._read(f'{voxel}/sensors', sensors, partial(self._sensed, i)):
                frame['area'][i], frame['touch'][i] = self._shown(readings)
            for a in self._read(f'{voxel}/actuation', actuation, partial(self._acted, i)):
                frame['actuation'][i] = a
            said += self._read(f'{voxel}/messages', messages, partial(self._said, i))
        if 'step' in frame and 'corners' in frame:
            self._tell({**frame, 'said': said})

    def _shown(self, readings: np.ndarray) -> list[float | None]:
        """Return area ratio and touch of a voxel from its readings; None where it has no sensor."""
        numbers = (area_ratios(readings, self._names), readings_of('touch', readings, self._names))
        return [round(float(n), _DIGITS) if np.isfinite(n) else None for n in numbers]

    def _read(
        self, topic: str, take: Callable[[], list[bytes]], read: Callable[[bytes], Any]
    ) -> list[Any]:
        """Return what `read` makes of the messages that have come; others are refused."""
        found = []
        for data in take():
            try:
                found.append(read(data))
            except Exception as error:  # also what rclpy says about bytes of another layout
                self.refuse(topic, error)
        return found

    def _placed(self, data: bytes) -> tuple[int, float, float]:
        stamp, (position,) = self._odometry_wire.decode(data, 'position')
        return step_of_stamp(*stamp), float(position[0]), float(position[2])

    def _sensed(self, i: int, data: bytes) -> np.ndarray:
        return topics.read_joint_state(self._sensors[i], data, 0.0, 1.0)[2]

    def _acted(self, i: int, data: bytes) -> float:
        return float(topics.read_joint_state(self._actuation[i], data, -1.0, 1.0)[2][0])

    def _said(self, i: int, data: bytes) -> list[Any]:
        """Return step, voxel, and a number per channel: a spike train as an integer, or a value."""
        _, step, message = self._messages[i].decode(data)
        rows = message.reshape(-1, message.shape[-1])
        if not self._spiking:
            return [step, i, rows.ravel().tolist()]
        return [step, i, (rows @ (1 << np.arange(SNN_STEPS))).astype(int).tolist()]
