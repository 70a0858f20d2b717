"""When a voxel joins, waits and steps, and what is late, repeated or of another episode.

Nothing in here publishes, keeps time or knows ROS: the node tells what has come and what the time
is, and publishes what it is given.
"""

from collections import deque
from collections.abc import Callable, Iterable
from enum import Enum
from typing import NamedTuple

import numpy as np

from sim_node.control_time import START_STEPS
from sim_node.errors import InvalidInput
from sim_node.model.morphology import OPPOSITE
from sim_node.ros.delivery import Link
from snca_ros.nodes.inbox import Pending
from snca_ros.nodes.own_part import OwnPart

_JOIN_LIMIT = 0.2  # seconds after the first news; in real time there is no pause
_EPISODES = 16  # past ones that are remembered
_LOOK_SELDOM = 0.05  # seconds between looks at last: the neighbour may be dead
_QUIET = 15  # steps without a message after which a neighbour is named

LOOK_PERIOD = 0.001
"""Seconds between looks for a neighbour's message that is late, at first."""


class Heard(Enum):
    """What sensors were: taken, or why not, as the diagnostics count it."""

    TAKEN = 'taken'
    REPEATED = 'repeated sensors'
    PAST = 'sensors of a past episode'


class Answer(NamedTuple):
    """What a voxel says in a control step."""

    episode: bytes
    step: int
    outbox: np.ndarray
    """(n_destinations, n_c, width) spikes 0.0/1.0 or values, for the neighbours."""
    actuation: float
    """In [-1, 1]."""
    fallen: tuple[int, ...]
    """Directions of the neighbours that are taken for silent from this step on."""


class VoxelCore:
    """One voxel: its cell, and what it has heard and not yet used.

    In lock-step it steps when it holds sensors(k) and its neighbours' messages(k - 1); a neighbour
    for which it has waited `patience` is taken for silent until it speaks again. In real time it
    steps when sensors come, and what it has not heard is silence. When the simulation starts anew
    or is reset, an episode begins, and so does the voxel.

    The messages of one neighbour are to be told in the order in which it has said them, and none
    before the voxel has joined: what others have said long ago would take the room of the newest.

    Args:
        part: its cell and the faults of it.
        directions: indices of DIRECTIONS in which it has neighbours.
        patience: how long it waits for a neighbour [s]; 0: for ever.
        real_time: it never waits, but for the first steps.
        horizon: how many steps after the newest sensors a message may be of.

    Attributes:
        joined: it takes part.
        held_back: it does not, because another node answers for it.
        episode: the present one; empty before the first.
        step: k of the newest sensors; -1 before the first.
        since: when they came [s].
        sensors_link, links: accounts of what came; of the neighbours by direction.
    """

    def __init__(
        self, part: OwnPart, directions: Iterable[int], *, patience: float, real_time: bool,
        horizon: int,
    ) -> None:
        self._cells, self._faults = part.cells, part.faults
        self._directional = part.architecture.directional
        self._patience, self._real_time, self._horizon = patience, real_time, horizon
        self._received = {d: Pending() for d in directions}
        self._past: deque[bytes] = deque(maxlen=_EPISODES)
        self.joined = self.held_back = False
        self.sensors_link, self.links = Link(), {d: Link() for d in self._received}
        self.episode = b''
        self._restart(b'', 0.0)

    def _restart(self, episode: bytes, now: float) -> None:
        """Start afresh: the simulation has, or was reset.

        What neighbours that noticed it first have said in the new episode is kept.
        """
        self._past.append(self.episode)
        self.episode = episode
        self._cells.reset()
        self._faults.reset()
        self._inbox = self._cells.silence()
        self._readings: np.ndarray | None = None  # sensors(k) not yet answered
        self.step = -1
        self.since = self._first_heard = now
        self._silent: set[int] = set()
        for link in (self.sensors_link, *self.links.values()):
            link.restart()

    def hear_sensors(self, episode: bytes, step: int, readings: np.ndarray, now: float) -> Heard:
        """Take sensors unless they are repeated or of a past episode.

        Args:
            episode: name of their episode.
            step: control step k.
            readings: (n_sensors,) in [0, 1].
            now: the time [s].

        Raises:
            InvalidInput: the step is further ahead than a voxel that catches up can see.
        """
        self._check_future(episode, step)
        if episode in self._past:
            return Heard.PAST
        if episode != self.episode:
            self._restart(episode, now)
        elif step <= self.step:
            self.sensors_link.note_late(step)
            return Heard.REPEATED
        self.sensors_link.arrive(step)
        self.step, self._readings, self.since = step, readings, now
        for pending in self._received.values():
            pending.turn_to(episode, step - 1)
        return Heard.TAKEN

    def hear_neighbor(
        self, direction: int, episode: bytes, step: int, message: np.ndarray
    ) -> bool:
        """Keep what a neighbour says; return whether it was neither late nor repeated.

        Args:
            direction: where the neighbour is.
            episode: name of the episode in which it speaks.
            step: control step k.
            message: (n_destinations, n_c, width) spikes 0.0/1.0 or values.

        Raises:
            InvalidInput: the step is further ahead than a voxel that catches up can see.
        """
        self._check_future(episode, step)
        if episode == self.episode:
            self.links[direction].note_late(step)
        self._silent.discard(direction)
        return self._received[direction].put(episode, step, message)

    def _check_future(self, episode: bytes, step: int) -> None:
        latest = self.step + self._horizon
        if episode == self.episode and step > latest:
            raise InvalidInput('stamp', f'step {step}', f'at most step {latest}')

    @property
    def joining(self) -> bool:
        """Tell, when sensors have come, whether to wait for newer ones before taking part.

        A voxel that joins late is first told the steps that others have made long ago; to answer
        those would take its neighbours back with it.
        """
        return not self.joined and self.since - self._first_heard < _JOIN_LIMIT

    def join(self, answers: Callable[[bytes], bool]) -> bool:
        """Take part from the newest step on, if there is one; return whether the voxel does now.

        Args:
            answers: tells whether another node answers for this voxel in an episode.
        """
        self.held_back = self.unanswered and answers(self.episode)
        self.joined = self.joined or (self.unanswered and not self.held_back)
        return self.joined

    @property
    def unanswered(self) -> bool:
        """Tell whether it holds sensors that it has not answered."""
        return self._readings is not None

    @property
    def awaited(self) -> list[int]:
        """Return the directions from which a message of the step before is still to come.

        A neighbour that has already said something later will not say it any more: it was killed
        in the middle of it, and started again.
        """
        if self.step < 1 or (self._real_time and self.step >= START_STEPS):
            return []
        return [
            d for d, said in self._received.items()
            if self.step - 1 not in said and self.step not in said and d not in self._silent
        ]

    @property
    def quiet(self) -> list[int]:
        """Return the directions of neighbours from which nothing has come for long."""
        return [d for d, link in self.links.items() if self.step - link.newest > _QUIET]

    def look_period(self, now: float) -> float:
        """Return how long [s] to wait before looking for messages again, when some are awaited."""
        return min(max((now - self.since) / 4.0, LOOK_PERIOD), _LOOK_SELDOM)

    def answer(self, now: float) -> Answer | None:
        """Step if it may; return what to publish, None if it is not yet time.

        Args:
            now: the time [s].
        """
        if self._readings is None or not self.joined:
            return None
        if fallen := tuple(self.awaited):
            # At first neighbours may still be looking for each other.
            patience = self._patience if self.step > START_STEPS else 10.0 * self._patience
            if not patience or now - self.since < patience:
                return None
            self._silent.update(fallen)
        self._collect()
        heard = self._faults.hear(self.step, self._inbox)
        if self._faults.dead(self.step):
            self._cells.reset()  # limp, silent, and to start afresh
            a = 0.0
        else:
            a = self._cells.step_cell(0, self._readings, heard, self.step)
        self._readings = None
        return Answer(self.episode, self.step, self._cells.outbox[0], a, fallen)

    def _collect(self) -> None:
        """Move the neighbours' messages of the step before into the inbox."""
        for d, pending in self._received.items():
            message = pending.pop(self.step - 1)
            if self.step > 0:
                self.links[d].close_step(self.step - 1, message is not None)
            if message is None:
                self._inbox[d] = 0.0
            else:
                self._inbox[d] = message[OPPOSITE[d] if self._directional else 0]
