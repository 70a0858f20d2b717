"""(ROS) The simulation's topics: QoS, and conversion of their messages to and from arrays."""

from collections.abc import Sequence

import numpy as np
from geometry_msgs.msg import Point
from nav_msgs.msg import Odometry
from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import ColorRGBA
from visualization_msgs.msg import Marker, MarkerArray

from sim_node import message_layout
from sim_node.control_time import step_of_stamp
from sim_node.drawing import area_colors
from sim_node.episode import EXAMPLE_EPISODE, check_frame, frame_of
from sim_node.errors import InvalidInput
from sim_node.ros.cdr import WireFormat
from sim_node.ros.sim_interface import BEST_EFFORT

WORLD_FRAME = 'world'

QUEUE = 256
"""Depth of the subscription queues of voxels and simulation.

Lock-step needs two. The rest absorbs a publisher that floods a topic, for a quarter of a second at
1 kHz.
"""

HISTORY = 1000
"""Depth of the publishers' history, for subscribers that join late or read slowly."""


def stream_qos(depth: int = HISTORY) -> QoSProfile:
    """Return the QoS of all topics whose messages are stamped with a control step, if reliable.

    Reliable, and transient-local so that a node which joins late receives the last messages.
    Publishers keep many steps, so that a recorder may fall behind without losing messages.
    """
    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE,
        durability=DurabilityPolicy.TRANSIENT_LOCAL,
    )


def link_qos(reliability: str, depth: int = HISTORY) -> QoSProfile:
    """Return the QoS of the links: sensors, actuation, spikes and values.

    Reliable links have that of `stream_qos`. Best-effort ones are volatile, too, as DDS keeps for
    late joiners only what it can send again. A best-effort subscription matches both.

    Args:
        reliability: `RELIABLE` or `BEST_EFFORT`.
        depth: of the queue.
    """
    qos = stream_qos(depth)
    if reliability == BEST_EFFORT:
        qos.reliability = ReliabilityPolicy.BEST_EFFORT
        qos.durability = DurabilityPolicy.VOLATILE
    return qos


def _joint_state_format(
    sender: str, names: list[str], with_effort: bool = False
) -> WireFormat:
    numbers = np.arange(1.0, len(names) + 1.0) / 7.0
    effort = -numbers if with_effort else np.zeros(0)
    message = JointState(name=names, position=numbers.tolist(), effort=effort.tolist())
    message.header.frame_id = frame_of(sender)

    def check(received: JointState) -> None:
        if list(received.name) != names:
            raise InvalidInput('name', list(received.name), str(names))
        if len(received.position) != len(names):
            raise InvalidInput(
                'position', f'{len(received.position)} values', f'{len(names)} values'
            )
        if received.velocity or len(received.effort) != len(effort):
            shown = f'{len(received.velocity)} and {len(received.effort)} values'
            raise InvalidInput('velocity, effort', shown, f'none and {len(effort) or "none"}')
        check_frame(sender, received.header.frame_id)

    layout = message_layout.joint_state(sender, EXAMPLE_EPISODE, names, len(effort))
    slots: dict[str, np.ndarray] = {
        'position': numbers, 'episode': np.frombuffer(EXAMPLE_EPISODE, np.uint8)
    }
    if with_effort:
        slots['effort'] = effort
    return WireFormat(message, layout, slots, check)


def sensors_format(voxel: str, sensors: Sequence[str]) -> WireFormat:
    """Return the format of `<voxel>/sensors`: names of the sensors; position = their readings."""
    return _joint_state_format(voxel, list(sensors))


def actuation_format(voxel: str) -> WireFormat:
    """Return the format of `<voxel>/actuation`; position = [a]."""
    return _joint_state_format(voxel, [voxel])


def applied_format(robot: str, voxels: Sequence[str]) -> WireFormat:
    """Return the format of `applied_actuation`; position = actuation, effort = ages in steps."""
    return _joint_state_format(robot, list(voxels), with_effort=True)


def read_joint_state(wire: WireFormat, data: bytes, low: float, high: float):
    """Return (episode, step, numbers) of a serialised message of sensors or actuation.

    Args:
        wire: format of the message.
        data: the serialised message.
        low, high: inclusive range of the numbers.

    Raises:
        InvalidInput: a fixed part, the stamp or a number is not valid.
    """
    try:
        stamp, (numbers, episode) = wire.decode(data, 'position', 'episode')
    except InvalidInput:
        raise
    except Exception as error:
        raise InvalidInput('message', str(error), 'a sensor_msgs/JointState') from None
    if not all(low <= number <= high for number in numbers.tolist()):
        raise InvalidInput('position', numbers.tolist(), f'numbers from {low:g} to {high:g}')
    return episode.tobytes(), step_of_stamp(*stamp), numbers


def clock_format() -> WireFormat:
    """Return the format of /clock."""
    return WireFormat(Clock(), message_layout.clock(), {})


def odometry_format(child_frame: str) -> WireFormat:
    """Return the format of `odometry`: robot centre [m] and velocity [m/s], x forward, z up.

    Motion is planar. The orientation is always the identity, so pose and twist have the same axes.
    """
    position, velocity = np.array([1.5, 2.5, 3.5]), np.array([4.5, 5.5, 6.5])
    message = Odometry(child_frame_id=child_frame)
    message.header.frame_id = WORLD_FRAME
    pose, twist = message.pose.pose.position, message.twist.twist.linear
    pose.x, pose.y, pose.z = position
    twist.x, twist.y, twist.z = velocity
    layout = message_layout.odometry(WORLD_FRAME, child_frame)
    return WireFormat(message, layout, {'position': position, 'velocity': velocity})


def upright(vector: np.ndarray) -> np.ndarray:
    """Convert vectors (..., 2) of the simulation to (..., 3) x forward, y left, z up (REP 103)."""
    out = np.zeros((*vector.shape[:-1], 3))
    out[..., 0], out[..., 2] = vector[..., 0], vector[..., 1]
    return out


_TRIANGLES = np.array([0, 1, 2, 0, 2, 3])
_CORNERS = [0, 1, 2, 5]  # index of each corner's first occurrence in _TRIANGLES
_OUTLINE = np.array([0, 1, 1, 2, 2, 3, 3, 0])


class RobotMarkers:
    """The format of the robot's MarkerArray: voxels coloured by area ratio, and their outlines."""

    def __init__(self, n_voxels: int) -> None:
        n_fill, n_line = n_voxels * len(_TRIANGLES), n_voxels * len(_OUTLINE)
        fill = np.arange(1.0, 3 * n_fill + 1).reshape(-1, 3) / 3.0
        line = np.arange(1.0, 3 * n_line + 1).reshape(-1, 3) / 7.0
        color = (np.arange(1.0, 4 * n_fill + 1).reshape(-1, 4) / 11.0).astype(np.float32)
        voxels = _marker('voxels', 0, Marker.TRIANGLE_LIST, 1.0)
        voxels.points = _points(fill)
        voxels.colors = [ColorRGBA(r=r, g=g, b=b, a=a) for r, g, b, a in color.tolist()]
        outlines = _marker('outlines', 0, Marker.LINE_LIST, 0.06)
        outlines.points = _points(line)
        outlines.color = ColorRGBA(r=0.1, g=0.1, b=0.1, a=1.0)
        # Stamp 0 means "the latest" to viewers, so that no marker is ever too old to be drawn.
        self._wire = WireFormat(
            MarkerArray(markers=[voxels, outlines]),
            message_layout.markers(
                (WORLD_FRAME, 'voxels', n_fill, n_fill), (WORLD_FRAME, 'outlines', n_line, 0)
            ),
            {'voxels_points': fill, 'voxels_colors': color, 'outlines_points': line},
        )
        self._size = len(self._wire.encode())

    def encode(self, corners: np.ndarray, area_ratios: np.ndarray) -> bytes:
        """Return the serialised MarkerArray of (n, 4, 2) corners [m] and (n,) area ratios."""
        points = upright(corners)
        colors = np.repeat(area_colors(area_ratios), len(_TRIANGLES), axis=0)
        return self._wire.encode(
            voxels_points=points[:, _TRIANGLES],
            voxels_colors=colors,
            outlines_points=points[:, _OUTLINE],
        )

    def decode(self, data: bytes) -> np.ndarray | None:
        """Return the corners, (n, 4, 2) [m], in a message of `encode`; None for other messages."""
        try:
            _, (fill,) = self._wire.decode(data[: self._size], 'voxels_points')  # DDS adds padding
        except Exception:  # rclpy raises various errors for other layouts
            return None
        return fill.reshape(-1, len(_TRIANGLES), 3)[:, _CORNERS][..., [0, 2]]


def ground_markers(x: np.ndarray, y: np.ndarray) -> MarkerArray:
    """Return the ground's profile as one line marker."""
    ground = _marker('ground', 0, Marker.LINE_STRIP, 0.1)
    ground.points = [Point(x=float(a), z=float(b)) for a, b in zip(x, y, strict=True)]
    ground.color = ColorRGBA(r=0.4, g=0.4, b=0.4, a=1.0)
    return MarkerArray(markers=[ground])


def _marker(namespace: str, number: int, kind: int, scale: float) -> Marker:
    marker = Marker(ns=namespace, id=number, type=kind, action=Marker.ADD)
    marker.header.frame_id = WORLD_FRAME
    marker.pose.orientation.w = 1.0
    marker.scale.x = scale
    if kind == Marker.TRIANGLE_LIST:
        marker.scale.y = marker.scale.z = scale
    return marker


def _points(places: np.ndarray) -> list[Point]:
    return [Point(x=x, y=y, z=z) for x, y, z in places.tolist()]
