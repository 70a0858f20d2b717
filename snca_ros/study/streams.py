"""The stamped topics of a bag as numbers over control steps, cut into episodes."""

import functools
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from sim_node.errors import InvalidInput
from sim_node.sensors import N_SENSORS
from sim_node.stamps import step_of_stamp
from snca_ros.cell.coding import SNN_STEPS
from snca_ros.study.storage import Topic


@dataclass(frozen=True, eq=False)
class Stream:
    """Messages of one topic.

    Attributes:
        steps: (n,) control steps from their stamps, in the order of their arrival.
        times: (n,) wall time of their arrival [ns].
        numbers: (n, ...) what they say.
    """

    steps: np.ndarray
    times: np.ndarray
    numbers: np.ndarray

    @classmethod
    def empty(cls, kind: 'Kind') -> 'Stream':
        """Return the stream of a topic of which nothing came."""
        none = np.zeros(0, dtype=np.int64)
        return cls(none, none, np.zeros((0, *np.maximum(kind.shape, 0))))

    def starts(self) -> np.ndarray:
        """Return the index of the first message, and of those after the stamps went back."""
        return np.flatnonzero(np.diff(self.steps, prepend=np.iinfo(np.int64).max) < 0)

    def episode(self, number: int, resets: np.ndarray) -> 'Stream':
        """Return the messages of one episode, at most one per control step.

        A reset reaches every topic at another moment: a late answer may follow the robot's step
        0. So a topic's messages since its own last going back count as one, and belong to the
        episode in which the first of them came.

        Args:
            number: of the episode, from 0.
            resets: (n_episodes - 1,) wall time [ns] of the robot's last word before each reset.
        """
        starts = self.starts()
        lengths = np.diff(starts, append=len(self.steps))
        of_message = np.repeat(np.searchsorted(resets, self.times[starts]), lengths)
        mine = np.flatnonzero(of_message == number)
        steps, first = np.unique(self.steps[mine], return_index=True)
        return Stream(steps, self.times[mine[first]], self.numbers[mine[first]])


@dataclass(frozen=True)
class Kind:
    """What messages of a kind of topic are: their type, and how their numbers are read."""

    type: str
    read: Callable[[Any], object]
    shape: tuple[int, ...]  # of the numbers; -1: any, but the same in all messages


def decode(name: str, topic: Topic, kind: str) -> Stream:
    """Return the messages of `topic`, which is called `name`, as numbers.

    Args:
        kind: one of `KINDS`.

    Raises:
        InvalidInput: its type, a stamp or a number is not what it should be.
    """
    expected = KINDS[kind]
    if topic.type != expected.type:
        raise InvalidInput(f'type of {name}', topic.type, expected.type)
    steps, numbers = [], []
    try:
        for data in topic.messages:
            message = _types().deserialize_cdr(data, topic.type)
            stamp = message.clock if kind == 'clock' else message.header.stamp
            steps.append(step_of_stamp(stamp.sec, stamp.nanosec))
            numbers.append(expected.read(message))
        shape = expected.shape if numbers else np.maximum(expected.shape, 0)
        array = np.array(numbers).reshape(len(numbers), *shape)
    except InvalidInput as error:
        raise error.found_in(name) from None
    except Exception as error:  # what rosbags and numpy say about bytes of another layout
        reason = ' '.join(str(error).split())
        raise InvalidInput(name, reason, f'{topic.type} of shape {expected.shape}') from None
    if not np.isfinite(array).all():
        raise InvalidInput(name, 'a number that is not finite', 'finite numbers')
    return Stream(np.array(steps, dtype=np.int64), topic.times, array)


@functools.cache
def _types():
    return get_typestore(Stores.ROS2_JAZZY)


def _spikes(message) -> np.ndarray:
    """Return (channels, 16) uint8, 0 or 1."""
    pixels = _pixels(message, 'mono8', np.uint8)
    if not ((pixels == 0) | (pixels == 255)).all():
        raise InvalidInput('data', 'other pixels', '0 or 255 in every pixel')
    return pixels // 255


def _pixels(message, encoding: str, dtype: type) -> np.ndarray:
    if message.encoding != encoding:
        raise InvalidInput('encoding', message.encoding, encoding)
    return message.data.view(dtype).reshape(message.height, message.width)


KINDS = {
    'odometry': Kind(
        'nav_msgs/msg/Odometry', lambda m: (m.pose.pose.position.x, m.pose.pose.position.z), (2,)
    ),
    'clock': Kind('rosgraph_msgs/msg/Clock', lambda m: (), (0,)),
    'sensors': Kind('sensor_msgs/msg/JointState', lambda m: m.position, (N_SENSORS,)),
    'actuation': Kind('sensor_msgs/msg/JointState', lambda m: m.position, (1,)),
    'spikes': Kind('sensor_msgs/msg/Image', _spikes, (-1, SNN_STEPS)),
    'values': Kind('sensor_msgs/msg/Image', lambda m: _pixels(m, '64FC1', np.float64), (-1, 1)),
}
"""The topics that carry control steps, by the last part of their name."""
