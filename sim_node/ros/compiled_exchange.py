"""(ROS) The simulation's exchange with its voxels in compiled code: answers in, sensors out."""

from collections.abc import Sequence

import numpy as np
from rclpy.publisher import Publisher

from sim_node.numerics.jit import compiled, entry_point, warm_up
from sim_node.ros.cdr import WireFormat
from sim_node.ros.endpoints import (
    matches,
    numbers,
    publish,
    publishers,
    set_episode,
    set_step,
    subscriptions,
)


@compiled
def _read_answer(data, i, answers, step, actuation, awaited):
    """Read an awaited answer of voxel i; return whether `data` is one.

    Args:
        data: bytes of a message.
        i: index of the voxel.
        answers: Endpoints of all voxels' actuation.
        step: control step whose sensors it must answer.
        actuation: (n_voxels,), written.
        awaited: (n_voxels,) bool, whose answers are awaited, written.
    """
    set_step(answers, i, step)
    if not (awaited[i] and matches(answers, i, data)):
        return False
    a = numbers(answers, i)[0]
    if not -1.0 <= a <= 1.0:
        return False
    actuation[i] = a
    awaited[i] = False
    return True


@compiled
def _publish_sensors(sensors, step, readings):
    """Publish each voxel's (n_voxels, n_sensors) readings of a step."""
    for i in range(len(readings)):
        set_step(sensors, i, step)
        numbers(sensors, i)[:] = readings[i]
        publish(sensors, i)


class CompiledExchange:
    """Reads answers and publishes sensors.

    Args:
        answers: format of each voxel's actuation.
        sensors: publisher and format of each voxel's sensors.
    """

    def __init__(
        self, answers: Sequence[WireFormat], sensors: Sequence[tuple[Publisher, WireFormat]]
    ) -> None:
        n = len(answers)
        to_voxels, formats = zip(*sensors, strict=True)
        self._answers = subscriptions([None] * n, answers, ['position'] * n)
        self._sensors = publishers(to_voxels, formats, ['position'] * n)

        answer = b'', 0, self._answers, 0, np.zeros(n), np.zeros(n, dtype=bool)
        self._read = warm_up('answers', lambda: entry_point(_read_answer, *answer))
        step = self._sensors, 0, np.zeros((n, 1))
        self._publish = warm_up('sensors', lambda: entry_point(_publish_sensors, *step))

    def begin_episode(self, episode: bytes) -> None:
        """Accept and send messages of this episode from now on."""
        set_episode(self._answers, episode)
        set_episode(self._sensors, episode)

    def read_answer(
        self, i: int, data: bytes, step: int, actuation: np.ndarray, awaited: np.ndarray
    ) -> bool:
        """Read the actuation of voxel i if it is awaited and answers `step`; return whether it does.

        Args:
            i: index of the voxel.
            data: the message.
            step: control step.
            actuation: (n_voxels,), written.
            awaited: (n_voxels,) bool, written.
        """
        return self._read(data, i, self._answers, step, actuation, awaited)

    def publish_sensors(self, step: int, readings: np.ndarray) -> None:
        """Publish each voxel's readings, (n_voxels, n_sensors), at a control step."""
        self._publish(self._sensors, step, readings)
