"""Decodes the stamped topics of a bag into numbers over control steps, split into episodes."""

import functools
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from sim_node.control_time import step_of_stamp
from sim_node.episode import episode_of
from sim_node.errors import InvalidInput
from snca_ros.cell.coding import SNN_STEPS
from snca_ros.recording.storage import Topic


@dataclass(frozen=True, eq=False)
class Stream:
    """Decoded messages of one topic.

    Attributes:
        steps: (n,) control steps from their stamps, in the order in which they were recorded.
        times: (n,) wall time at which they were recorded [ns].
        numbers: (n, ...) their content.
        names: (n,) bytes, name of the episode in their frame_id; empty if there is none.
        refused: number of other messages on the topic that are invalid; nodes refuse them, too.
        fields: names of the numbers, if messages contain them.
    """

    steps: np.ndarray
    times: np.ndarray
    numbers: np.ndarray
    names: np.ndarray
    refused: int = 0
    fields: tuple[str, ...] = ()

    @classmethod
    def empty(cls, kind: 'Kind') -> 'Stream':
        """Return the stream of a topic without messages."""
        none = np.zeros(0, dtype=np.int64)
        return cls(none, none, np.zeros((0, *np.maximum(kind.shape, 0))), none.astype('S'))

    def starts(self) -> np.ndarray:
        """Return the index of the first message and of each message whose stamp goes back."""
        return np.flatnonzero(np.diff(self.steps, prepend=np.iinfo(np.int64).max) < 0)

    def episode(self, number: int, resets: np.ndarray) -> 'Stream':
        """Return the messages of one episode, at most one per control step.

        A reset takes effect at a different time on every topic: a late answer may be recorded after
        the odometry of step 0. So messages are assigned in runs of increasing steps: a run belongs
        to the episode in which its first message was recorded.

        Args:
            number: of the episode, from 0.
            resets: (n_episodes - 1,) wall time [ns] of the last odometry before each reset.
        """
        starts = self.starts()
        lengths = np.diff(starts, append=len(self.steps))
        of_message = np.repeat(np.searchsorted(resets, self.times[starts]), lengths)
        mine = np.flatnonzero(of_message == number)
        steps, first = np.unique(self.steps[mine], return_index=True)
        kept = mine[first]
        return Stream(
            steps, self.times[kept], self.numbers[kept], self.names[kept], self.refused,
            self.fields,
        )

    def until(self, step: int) -> 'Stream':
        """Return the messages up to a step, and count the later ones as refused."""
        kept = self.steps <= step
        return Stream(
            self.steps[kept], self.times[kept], self.numbers[kept], self.names[kept],
            self.refused + int((~kept).sum()), self.fields,
        )


@dataclass(frozen=True)
class Kind:
    """A kind of topic: its message type, and how to read the numbers of a message."""

    type: str
    read: Callable[[Any], object]
    shape: tuple[int, ...]  # of the numbers; -1: any, but the same in all messages
    of_voxel: bool = True  # whether frame_id names a voxel
    named: bool = False  # whether the field `name` names the numbers


def decode(name: str, topic: Topic, kind: str) -> Stream:
    """Return the decoded messages of a topic.

    Args:
        name: of the topic.
        topic: its messages.
        kind: one of `KINDS`.

    Raises:
        InvalidInput: the topic has another type than its kind, or all of its messages are invalid.
    """
    expected = KINDS[kind]
    if topic.type != expected.type:
        raise InvalidInput(f'type of {name}', topic.type, expected.type)
    found: list[tuple[int, int, np.ndarray, bytes, tuple[str, ...]]] = []
    reason: Exception | None = None
    for time, data in zip(topic.times.tolist(), topic.messages, strict=True):
        try:
            step, numbers, episode, fields = _read(name, expected, data)
        except Exception as error:  # rosbags and numpy raise various ones for another layout
            reason = error
        else:
            found.append((step, time, numbers, episode, fields))
    if not found and reason is not None:
        text = ' '.join(str(reason).split())
        raise InvalidInput(name, text, f'{topic.type} of shape {expected.shape}')
    layouts = Counter((numbers.shape, fields) for _, _, numbers, _, fields in found)
    none = tuple(np.maximum(expected.shape, 0)), ()
    shape, fields = layouts.most_common(1)[0][0] if layouts else none
    good = [entry for entry in found if (entry[2].shape, entry[4]) == (shape, fields)]
    return Stream(
        np.array([step for step, *_ in good], dtype=np.int64),
        np.array([time for _, time, *_ in good], dtype=np.int64),
        np.array([numbers for _, _, numbers, *_ in good]).reshape(len(good), *shape),
        np.array([episode for *_, episode, _ in good], dtype='S'),
        len(topic.messages) - len(good),
        fields,
    )


def _read(
    name: str, kind: Kind, data: bytes
) -> tuple[int, np.ndarray, bytes, tuple[str, ...]]:
    """Return step, numbers, and names of the episode and of the numbers.

    Raises:
        Exception: of any kind if the data are invalid.
    """
    message = _types().deserialize_cdr(data, kind.type)
    stamp = message.clock if kind is KINDS['clock'] else message.header.stamp
    voxel = name.split('/')[-2]
    if kind.of_voxel and message.header.frame_id.partition('@')[0] != voxel:
        raise InvalidInput('frame_id', message.header.frame_id, voxel)
    numbers = np.array(kind.read(message))
    fits = len(numbers.shape) == len(kind.shape) and all(
        want in (-1, have) for want, have in zip(kind.shape, numbers.shape, strict=True)
    )
    if not fits:
        raise InvalidInput('shape', numbers.shape, str(kind.shape))
    if not np.isfinite(numbers).all():
        raise InvalidInput('numbers', 'infinity or NaN', 'finite numbers')
    fields = tuple(message.name) if kind.named else ()
    if kind.named and len({*fields}) != len(numbers):
        raise InvalidInput('name', fields, f'{len(numbers)} names')
    episode = episode_of(message.header.frame_id) if kind.of_voxel else b''
    return step_of_stamp(stamp.sec, stamp.nanosec), numbers, episode, fields


@functools.cache
def _types():
    return get_typestore(Stores.ROS2_JAZZY)


def _spikes(message) -> np.ndarray:
    """Return (channels, 16) uint8, 0 or 1."""
    pixels = _pixels(message, 'mono8', np.uint8)
    if not ((pixels == 0) | (pixels == 255)).all():
        raise InvalidInput('data', 'other pixel values', '0 or 255 in every pixel')
    return pixels // 255


def _pixels(message, encoding: str, dtype: type) -> np.ndarray:
    if message.encoding != encoding:
        raise InvalidInput('encoding', message.encoding, encoding)
    return message.data.view(dtype).reshape(message.height, message.width)


KINDS = {
    'odometry': Kind(
        'nav_msgs/msg/Odometry', lambda m: (m.pose.pose.position.x, m.pose.pose.position.z), (2,),
        of_voxel=False,
    ),
    'clock': Kind('rosgraph_msgs/msg/Clock', lambda m: (), (0,), of_voxel=False),
    'sensors': Kind('sensor_msgs/msg/JointState', lambda m: m.position, (-1,), named=True),
    'actuation': Kind('sensor_msgs/msg/JointState', lambda m: m.position, (1,)),
    'spikes': Kind('sensor_msgs/msg/Image', _spikes, (-1, SNN_STEPS)),
    'values': Kind('sensor_msgs/msg/Image', lambda m: _pixels(m, '64FC1', np.float64), (-1, 1)),
}
"""Kinds of topics whose stamps are control steps, by the last part of the topic's name."""
