"""(ROS) Reads the actuation of the voxels; expected answers in compiled code."""

from collections.abc import Sequence

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.numerics.jit import entry_point, warm_up
from sim_node.ros import rcl_functions, topics
from sim_node.ros.actuation_buffer import Answers
from sim_node.ros.endpoints import read_number, set_episode, subscriptions
from sim_node.ros.node_base import RosNode
from sim_node.ros.sim_interface import ACTUATION


class AnswerReader:
    """Reads messages of actuation into `Answers`.

    Args:
        node: refuses invalid messages, and counts those that do not count as answers.
        voxels: names of the voxels.
        answers: written.
    """

    def __init__(self, node: RosNode, voxels: Sequence[str], answers: Answers) -> None:
        self._node, self._voxels, self._answers = node, voxels, answers
        self._wires = [topics.actuation_format(voxel) for voxel in voxels]
        self._episode = b''
        self._compiled = None
        if rcl_functions.AVAILABLE:
            self._formats = subscriptions(
                [None] * len(voxels), self._wires, ['position'] * len(voxels)
            )
            self._compiled = warm_up('answers', lambda: entry_point(
                read_number, b'', 0, self._formats, 0, answers.actuation, answers.awaited
            ))

    def begin_episode(self, episode: np.ndarray) -> None:
        """Read answers of this episode from now on, as from `EpisodeNames`."""
        self._episode = episode.tobytes()
        if self._compiled:
            set_episode(self._formats, self._episode)

    def read(self, i: int, data: bytes, step: int, now: float) -> bool:
        """Read a message of voxel i; return whether it is an answer of this episode, also late.

        Args:
            i: index of the voxel.
            data: the message.
            step: the present step.
            now: the time [s].
        """
        answers = self._answers
        if self._compiled and self._compiled(
            data, i, self._formats, step, answers.actuation, answers.awaited
        ):
            answers.note(i, step, now)
            return True
        try:
            episode, sent, a = topics.read_joint_state(self._wires[i], data, -1.0, 1.0)
            if episode == self._episode and sent > step:
                raise InvalidInput('stamp', f'step {sent}', f'at most step {step}')
        except InvalidInput as error:
            self._node.refuse(ACTUATION.of(self._voxels[i]), error)
            return False
        if episode != self._episode:
            self._node.count('actuation of another episode')
            return False
        if not answers.take(i, sent, a[0], step, now):
            self._node.count('late or repeated actuation')
        return True
