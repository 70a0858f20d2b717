"""Decodes the stamped topics of a bag into numbers over control steps."""

import functools
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace
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
    """Decoded messages of one topic, in the order in which they were recorded.

    Attributes:
        steps: (n,) control steps from their stamps.
        order: (n,) place of each message among all messages of the bag, increasing.
        times: (n,) wall time at which they were recorded [ns]; for durations alone, since clocks
            can be set back.
        numbers: (n, ...) their content.
        names: (n,) bytes, name of the episode in their frame_id; empty if there is none.
        refused: number of other messages on the topic that are invalid; nodes refuse them, too.
        reason: why the last of these is invalid; empty if there are none.
        fields: names of the numbers, if messages contain them.
    """

    steps: np.ndarray
    order: np.ndarray
    times: np.ndarray
    numbers: np.ndarray
    names: np.ndarray
    refused: int = 0
    reason: str = ''
    fields: tuple[str, ...] = ()

    @classmethod
    def empty(cls, kind: str, refused: int = 0, reason: str = '') -> 'Stream':
        """Return the stream of a topic without valid messages; `kind` is one of `KINDS`."""
        none = np.zeros(0, dtype=np.int64)
        numbers = np.zeros((0, *np.maximum(KINDS[kind].shape, 0)))
        return cls(none, none, none, numbers, none.astype('S'), refused, reason)

    def select(self, kept: np.ndarray, refused: int = 0) -> 'Stream':
        """Return the messages at indices `kept`, and count `refused` more as invalid."""
        return replace(
            self, steps=self.steps[kept], order=self.order[kept], times=self.times[kept],
            numbers=self.numbers[kept], names=self.names[kept], refused=self.refused + refused,
        )

    def until(self, step: int) -> 'Stream':
        """Return the messages up to a step, and count the later ones as refused."""
        late = self.steps > step
        return self.select(np.flatnonzero(~late), int(late.sum()))


@dataclass(frozen=True)
class Kind:
    """A kind of topic: its message type, and how to read the numbers of a message."""

    type: str
    read: Callable[[Any], object]
    shape: tuple[int, ...]  # of the numbers; -1: any, but the same in all messages
    of_voxel: bool = True  # whether frame_id names a voxel
    of_episode: bool = True  # whether frame_id names an episode
    named: bool = False  # whether the field `name` names the numbers


def decode(topic: Topic, kind: str, voxel: str = '') -> Stream:
    """Return the decoded messages of a topic; invalid ones are only counted.

    Args:
        topic: its messages.
        kind: one of `KINDS`.
        voxel: name of the voxel whose topic it is.
    """
    expected = KINDS[kind]
    if topic.type != expected.type:
        reason = f'type {topic.type}, expected {expected.type}'
        return Stream.empty(kind, len(topic.messages) + topic.foreign, reason)
    found: list[tuple[int, int, np.ndarray, bytes, tuple[str, ...]]] = []
    reason = ''
    for i, data in enumerate(topic.messages):
        try:
            step, numbers, episode, fields = _read(voxel, expected, data)
        except Exception as error:  # rosbags and numpy raise various ones for another layout
            reason = ' '.join(str(error).split()) or type(error).__name__
        else:
            found.append((i, step, numbers, episode, fields))
    layouts = Counter((numbers.shape, fields) for _, _, numbers, _, fields in found)
    if not layouts:
        return Stream.empty(kind, len(topic.messages) + topic.foreign, reason)
    shape, fields = layouts.most_common(1)[0][0]
    good = [entry for entry in found if (entry[2].shape, entry[4]) == (shape, fields)]
    kept = np.array([i for i, *_ in good])
    return Stream(
        np.array([step for _, step, *_ in good], dtype=np.int64),
        topic.order[kept], topic.times[kept],
        np.array([numbers for _, _, numbers, *_ in good]).reshape(len(good), *shape),
        np.array([episode for *_, episode, _ in good], dtype='S'),
        len(topic.messages) - len(good) + topic.foreign,
        reason or ('another layout than most messages' if len(good) < len(found) else ''),
        fields,
    )


def _read(
    voxel: str, kind: Kind, data: bytes
) -> tuple[int, np.ndarray, bytes, tuple[str, ...]]:
    """Return step, numbers, and names of the episode and of the numbers.

    Raises:
        Exception: of any kind if the data are invalid.
    """
    message = types().deserialize_cdr(data, kind.type)
    stamp = message.clock if kind is KINDS['clock'] else message.header.stamp
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
    episode = episode_of(message.header.frame_id) if kind.of_episode else b''
    return step_of_stamp(stamp.sec, stamp.nanosec), numbers, episode, fields


@functools.cache
def types():
    """Return the message types of ROS 2 Jazzy."""
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


def _applied(message) -> np.ndarray:
    """Return (n_voxels, 2): actuation, and age of the answer in steps."""
    actuation, ages = message.position, message.effort
    if len(actuation) != len(ages) or not (np.abs(actuation) <= 1.0).all():
        raise InvalidInput('position, effort', actuation, 'actuation in [-1, 1], and its age')
    if not ((ages >= -1.0) & (ages == np.rint(ages))).all():
        raise InvalidInput('effort', ages, 'ages from -1')
    return np.column_stack([actuation, ages])


KINDS = {
    'odometry': Kind(
        'nav_msgs/msg/Odometry', lambda m: (m.pose.pose.position.x, m.pose.pose.position.z), (2,),
        of_voxel=False, of_episode=False,
    ),
    'clock': Kind(
        'rosgraph_msgs/msg/Clock', lambda m: (), (0,), of_voxel=False, of_episode=False
    ),
    'applied_actuation': Kind(
        'sensor_msgs/msg/JointState', _applied, (-1, 2), of_voxel=False, named=True
    ),
    'sensors': Kind('sensor_msgs/msg/JointState', lambda m: m.position, (-1,), named=True),
    'actuation': Kind('sensor_msgs/msg/JointState', lambda m: m.position, (1,)),
    'spikes': Kind('sensor_msgs/msg/Image', _spikes, (-1, SNN_STEPS)),
    'values': Kind('sensor_msgs/msg/Image', lambda m: _pixels(m, '64FC1', np.float64), (-1, 1)),
}
"""Kinds of topics whose stamps are control steps, by the last part of the declared name."""
