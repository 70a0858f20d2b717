"""Reads the outlines of the voxels and the terrain from the markers of a bag."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from sim_node import message_layout
from sim_node.control_time import MARKER_PERIOD
from sim_node.errors import InvalidInput
from snca_ros.recording.storage import Topic
from snca_ros.recording.streams import Stream

_TYPE = 'visualization_msgs/msg/MarkerArray'
_CORNERS = [0, 1, 2, 5]  # of the two triangles that make a voxel


@dataclass(frozen=True, eq=False)
class Poses:
    """A robot's outline at some control steps of an episode.

    Attributes:
        steps: (n_poses,) control steps, increasing.
        corners: (n_poses, n_voxels, 4, 2) outer corners x, y [m] of the voxels.
        ground: (n_points, 2) profile x, y [m] of the terrain.
    """

    steps: np.ndarray
    corners: np.ndarray
    ground: np.ndarray


def read_poses(
    topic: Topic, odometry: Stream, between: tuple[float, float], n_voxels: int
) -> Poses | None:
    """Return the poses of an episode, or None if the markers lack the robot or the ground.

    Markers carry no control step. If no message is missing, the step follows from its index;
    otherwise from the time at which it was recorded, to a step or two.

    Args:
        topic: the markers of a bag.
        odometry: of the episode.
        between: wall times [ns] between which the episode's markers were recorded.
        n_voxels: of the robot.

    Raises:
        InvalidInput: the topic has another type.
    """
    if topic.type != _TYPE:
        raise InvalidInput('type of markers', topic.type, _TYPE)
    corners, times, ground = _read(topic, n_voxels)
    mine = (times > between[0]) & (times < between[1])
    if ground is None or not mine.any():
        return None
    corners, times = corners[mine], times[mine]
    steps = MARKER_PERIOD * np.arange(len(times))
    if len(times) != int(odometry.steps[-1]) // MARKER_PERIOD + 1:
        newest = np.searchsorted(odometry.times, times, side='right') - 1
        steps = odometry.steps[np.maximum(newest, 0)] // MARKER_PERIOD * MARKER_PERIOD
        steps, first = np.unique(steps, return_index=True)
        corners = corners[first]
    return Poses(steps, corners, ground)


def _read(topic: Topic, n_voxels: int) -> tuple[np.ndarray, np.ndarray, np.ndarray | None]:
    """Return the corners and the time of each pose, and the ground.

    Messages of the same size with the same bytes before the points have the same layout: only the
    first of them is deserialised.
    """
    n = 6 * n_voxels
    found, times, ground = [], [], None
    head, size = b'', -1
    for time, data in zip(topic.times.tolist(), topic.messages, strict=True):
        if len(data) == size and data.startswith(head):
            points = np.frombuffer(data, np.float64, 3 * n, len(head))
        else:
            markers = _markers(data)
            by_name = {marker.ns: _points(marker.points) for marker in markers}
            ground = by_name['ground'][:, [0, 2]] if 'ground' in by_name else ground
            if len(by_name.get('voxels', ())) != n:
                continue
            points = by_name['voxels'].ravel()
            head, size = _head_and_size(data, markers[0], points)
        found.append(points)
        times.append(time)
    corners = np.array(found).reshape(-1, n_voxels, 6, 3)[:, :, _CORNERS][..., [0, 2]]
    return corners, np.array(times, dtype=np.int64), ground


def _head_and_size(data: bytes, first: Any, points: np.ndarray) -> tuple[bytes, int]:
    """Return the bytes before the points of a message's first marker, and the message's length.

    Returns (b'', -1), which matches no message, if `points` are not those of the first marker.
    """
    layout = message_layout.markers((first.header.frame_id, first.ns, len(points) // 3, 0))
    begin = message_layout.place(layout, f'{first.ns}_points')
    return (data[: begin.start], len(data)) if data[begin] == points.tobytes() else (b'', -1)


def _markers(data: bytes) -> list[Any]:
    """Return the markers of a message; none if it cannot be deserialised."""
    try:
        return _types().deserialize_cdr(data, _TYPE).markers
    except Exception:  # rosbags raises various ones for bytes of another layout
        return []


def _points(points: Sequence) -> np.ndarray:
    return np.array([(p.x, p.y, p.z) for p in points], dtype=np.float64).reshape(-1, 3)


@functools.cache
def _types():
    return get_typestore(Stores.ROS2_JAZZY)
