"""Reads the outlines of the voxels and the terrain from the markers of a bag."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim_node import message_layout
from sim_node.control_time import MARKER_PERIOD
from snca_ros.recording.episodes import nearest_of_any_step
from snca_ros.recording.storage import Topic
from snca_ros.recording.streams import Stream, types
from snca_ros.recording.topics import MARKERS_TYPE

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
    topic: Topic, odometry: Stream, mine: np.ndarray, n_voxels: int
) -> tuple[Poses | None, int]:
    """Return the poses of an episode, and how many markers are invalid.

    Markers carry no control step: they belong to the odometry that was recorded next to them. If no
    message is missing, the step follows from its index; otherwise from this odometry, to a step or
    two.

    Args:
        topic: the markers of a bag.
        odometry: of all episodes.
        mine: (n,) bool, which odometry is of the episode; at least one.
        n_voxels: of the robot.

    Returns:
        The poses, None if the markers lack the robot or the ground; and the number of messages of
        another type, that cannot be read, or with infinite numbers.
    """
    if topic.type != MARKERS_TYPE:
        return None, len(topic.messages) + topic.foreign
    corners, order, ground, refused = _read(topic, n_voxels)
    refused += topic.foreign
    near = nearest_of_any_step(odometry, order)
    of_episode = mine[near]
    if ground is None or not of_episode.any():
        return None, refused
    corners, found = corners[of_episode], odometry.steps[near[of_episode]]
    steps = MARKER_PERIOD * np.arange(len(found))
    in_order = not (np.diff(found) < 0).any()
    if not in_order or len(found) != int(odometry.steps[mine].max()) // MARKER_PERIOD + 1:
        steps, first = np.unique(found // MARKER_PERIOD * MARKER_PERIOD, return_index=True)
        corners = corners[first]
    return Poses(steps, corners, ground), refused


def _read(
    topic: Topic, n_voxels: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray | None, int]:
    """Return corners and place in the bag of each pose, the ground, and the number of refusals.

    Messages of the same size with the same bytes before the points have the same layout: only the
    first of them is deserialised.
    """
    n, refused = 6 * n_voxels, 0
    found, order, ground = [], [], None
    head, size = b'', -1
    for place, data in zip(topic.order.tolist(), topic.messages, strict=True):
        if len(data) == size and data.startswith(head):
            points = np.frombuffer(data, np.float64, 3 * n, len(head))
        else:
            markers = _markers(data)
            by_name = {marker.ns: _points(marker.points) for marker in markers or ()}
            if markers is None or not all(np.isfinite(p).all() for p in by_name.values()):
                refused += 1
                continue
            if len(by_name.get('ground', ())) > 1:
                ground = by_name['ground'][:, [0, 2]]
            if len(by_name.get('voxels', ())) != n:
                continue
            points = by_name['voxels'].ravel()
            head, size = _head_and_size(data, markers[0], points)
        if np.isfinite(points).all():
            found.append(points)
            order.append(place)
        else:
            refused += 1
    corners = np.array(found).reshape(-1, n_voxels, 6, 3)[:, :, _CORNERS][..., [0, 2]]
    return corners, np.array(order, dtype=np.int64), ground, refused


def _head_and_size(data: bytes, first: Any, points: np.ndarray) -> tuple[bytes, int]:
    """Return the bytes before the points of a message's first marker, and the message's length.

    Returns (b'', -1), which matches no message, if `points` are not those of the first marker.
    """
    layout = message_layout.markers((first.header.frame_id, first.ns, len(points) // 3, 0))
    begin = message_layout.place(layout, f'{first.ns}_points')
    return (data[: begin.start], len(data)) if data[begin] == points.tobytes() else (b'', -1)


def _markers(data: bytes) -> list[Any] | None:
    """Return the markers of a message; None if it cannot be deserialised."""
    try:
        return types().deserialize_cdr(data, MARKERS_TYPE).markers
    except Exception:  # rosbags raises various ones for bytes of another layout
        return None


def _points(points: Sequence) -> np.ndarray:
    return np.array([(p.x, p.y, p.z) for p in points], dtype=np.float64).reshape(-1, 3)
