"""Decides when a voxel joins, waits and steps, and which messages it drops.

This module does not import ROS: the voxel node passes it messages and the time, and publishes what
it returns.
"""

from collections.abc import Callable, Iterable
from typing import NamedTuple

import numpy as np

from sim_node.control_time import START_STEPS
from sim_node.errors import InvalidInput
from sim_node.ros.delivery import Delivery
from snca_ros.nodes.episode_choice import EpisodeChoice, Sensors, SensorsResult, Simulations
from snca_ros.nodes.inbox import Inbox
from snca_ros.nodes.own_cell import FaultyCell
from snca_ros.nodes.own_part import OwnPart

_JOIN_LIMIT = 0.2  # seconds after the first sensors, if there is no pause between them
_MAX_POLL_PERIOD = 0.05  # seconds; reached when the neighbour is probably dead

POLL_PERIOD = 0.001
"""Initial period [s] of polling for a neighbour's message that is late."""


class Answer(NamedTuple):
    """What a voxel publishes in a control step."""

    episode: bytes
    step: int
    outbox: np.ndarray
    """(n_destinations, n_c, width) spikes 0.0/1.0 or values, for the neighbours."""
    actuation: float
    """In [-1, 1]."""
    newly_silent: tuple[int, ...]
    """Directions of the neighbours that the voxel no longer waits for, from this step on."""


class VoxelCore:
    """The cell of one voxel with the received messages that it has not used yet.

    In lock-step it steps when it has sensors(k) and its neighbours' messages(k - 1). After it has
    waited `patience` for a neighbour, it takes that neighbour as silent until a message arrives. In
    real time it steps when sensors arrive, and a missing message means silence. When the simulation
    restarts or is reset, a new episode begins and the cell is reset. As long as the simulation of
    the current episode exists, sensors of another one, such as those in a bag that is played, are
    not used.

    The caller must pass the messages of each neighbour in the order of publication, and only after
    the voxel has joined: older messages would displace the newest ones.

    Args:
        part: the cell and its faults.
        directions: indices of DIRECTIONS in which the voxel has neighbours.
        patience: how long it waits for a neighbour [s]; 0 means without limit.
        real_time: whether it never waits, except in the first steps.
        horizon: how many steps a message may be ahead of the newest sensors.
        simulations: finds out which simulations exist.

    Attributes:
        cell: the cell with its faults.
        joined: whether it takes part.
        held_back: whether it does not take part because another node publishes for this voxel.
        episodes: the current episode, and which one may follow.
        step: control step k of the newest sensors; -1 before the first.
        since: time at which they arrived [s].
        sensors_delivery, deliveries: counts of messages on time, late and lost, from the
            simulation and from each neighbour, by direction.
    """

    def __init__(
        self, part: OwnPart, directions: Iterable[int], *, patience: float, real_time: bool,
        horizon: int, simulations: Simulations,
    ) -> None:
        self.cell = FaultyCell(part.cell, part.faults, part.architecture)
        self._patience, self._real_time, self._horizon = patience, real_time, horizon
        self.episodes = EpisodeChoice(simulations)
        self._inbox = Inbox(
            directions, part.architecture.directional, self.cell.empty_inbox(),
            self.episodes.is_live,
        )
        self.joined = self.held_back = False
        self.sensors_delivery, self.deliveries = Delivery(), self._inbox.deliveries
        self._reset(0.0)

    @property
    def episode(self) -> bytes:
        """Return the name of the current episode; empty before the first."""
        return self.episodes.episode

    def _reset(self, now: float) -> None:
        """Reset the cell for a new episode.

        Messages that neighbours have sent in the new episode already are kept.
        """
        self.cell.reset()
        self._inbox.restart()
        self.sensors_delivery.restart()
        self._readings: np.ndarray | None = None  # sensors(k) whose step has not begun
        self._newly_silent: tuple[int, ...] = ()  # in the step that has begun
        self.step = -1
        self._newest_published: int | None = None
        self.since = self._first_received = now

    def receive_sensors(
        self, episode: bytes, step: int, readings: np.ndarray, now: float
    ) -> SensorsResult:
        """Accept sensors unless they are repeated, of a past episode or of another simulation.

        Args:
            episode: name of their episode.
            step: control step k.
            readings: (n_sensors,) in [0, 1].
            now: the time [s].

        Raises:
            InvalidInput: the step is more than `horizon` ahead of the newest sensors.
        """
        self._check_horizon(episode, step)
        if episode != self.episode:
            if self.episodes.is_foreign(episode):
                self.episodes.ignore(Sensors(episode, step, readings, now))
                return SensorsResult.FOREIGN
            if self.episodes.is_past(episode):
                return SensorsResult.PAST
            self.episodes.begin(episode)
            self._reset(now)
        elif step <= self.step:
            self.sensors_delivery.note_late(step)
            return SensorsResult.REPEATED
        self.sensors_delivery.arrive(step)
        self.step, self._readings, self.since = step, readings, now
        self._inbox.advance_to(episode, step - 1)
        return SensorsResult.ACCEPTED

    def follow_other_simulation(self, now: float) -> bool:
        """Use ignored sensors if theirs is the only simulation now; return whether it did.

        Args:
            now: the time [s].
        """
        kept = self.episodes.take_ignored()
        return kept is not None and self.receive_sensors(
            kept.episode, kept.step, kept.readings, now
        ) is SensorsResult.ACCEPTED

    def receive_message(
        self, direction: int, episode: bytes, step: int, message: np.ndarray
    ) -> bool:
        """Keep a neighbour's message unless it is late or repeated; return whether it was neither.

        Args:
            direction: of the neighbour.
            episode: name of the message's episode.
            step: control step k.
            message: (n_destinations, n_c, width) spikes 0.0/1.0 or values.

        Raises:
            InvalidInput: the step is more than `horizon` ahead of the newest sensors.
        """
        self._check_horizon(episode, step)
        if episode == self.episode:
            self._inbox.note_arrival(direction, step)
        return self._inbox.put(direction, episode, step, message)

    def _check_horizon(self, episode: bytes, step: int) -> None:
        latest = self.step + self._horizon
        if episode == self.episode and step > latest:
            raise InvalidInput('stamp', f'step {step}', f'at most step {latest}')

    @property
    def joining(self) -> bool:
        """Return whether a voxel that has received sensors should wait for newer ones to join.

        A voxel that joins late receives first the sensors of steps that are over; it must not
        answer them. In lock-step it catches up after it has joined; in real time it joins at the
        newest step.
        """
        if self.joined:
            return False
        return self._behind or self.since - self._first_received < _JOIN_LIMIT

    @property
    def _behind(self) -> bool:
        """Return whether, in real time, there may be newer sensors than those received."""
        late = self._real_time and self.step >= START_STEPS
        newest = self._newest_published
        return late and (newest is None or self.step < newest)

    @property
    def needs_newest(self) -> bool:
        """Return whether a voxel that joins late does not know yet which step is the newest."""
        return not self.joined and self._behind and self._newest_published is None

    def note_published(self, episode: bytes, step: int) -> None:
        """Note that sensors have been published just now, so that older ones are over."""
        if episode == self.episode:
            self._newest_published = step

    def join(self, has_duplicate: Callable[[bytes], bool]) -> bool:
        """Take part from the newest step on, if there is one; return whether it takes part now.

        Args:
            has_duplicate: returns whether another node publishes for this voxel in an episode.
        """
        ready = self.unanswered and not self._behind
        self.held_back = ready and has_duplicate(self.episode)
        self.joined = self.joined or (ready and not self.held_back)
        return self.joined

    @property
    def missed_step(self) -> int | None:
        """Return the step for which a voxel that has just joined must send silence; None for none.

        It is the step before the one that it joins at. A neighbour that was restarted, too, waits
        for its message, which nobody else has kept. Others have it, or have gone on without.
        """
        return self.step - 1 if self._waits else None

    @property
    def _waits(self) -> bool:
        """Return whether the present step needs messages of the one before."""
        return self.step > 0 and not (self._real_time and self.step >= START_STEPS)

    @property
    def unanswered(self) -> bool:
        """Return whether there are sensors that the voxel has not answered."""
        return self._readings is not None or self.cell.busy

    @property
    def awaited(self) -> list[int]:
        """Return the directions from which a message of the last step has not arrived yet."""
        if self.cell.busy or not self._waits:
            return []
        return self._inbox.missing(self.step - 1)

    @property
    def overdue(self) -> list[int]:
        """Return the directions from which no message was on time in the last 15 steps."""
        return self._inbox.overdue(self.step)

    def poll_period(self, now: float) -> float:
        """Return how long to wait before the next check for awaited messages [s].

        Args:
            now: the time [s].
        """
        return min(max((now - self.since) / 4.0, POLL_PERIOD), _MAX_POLL_PERIOD)

    def answer(self, now: float) -> Answer | None:
        """Step the cell if its inputs are complete; return what to publish, or None.

        A device may answer later. Sensors that arrive meanwhile wait for its answer, as they do in
        the queue of a busy process; of several, the newest count.

        Args:
            now: the time [s].

        Raises:
            InvalidInput: the device runs other firmware.
        """
        if not self.cell.busy:
            self._begin_step(now)
        if (result := self.cell.poll(now)) is None:
            return None
        step, actuation, outbox = result
        return Answer(self.episode, step, outbox, actuation, self._newly_silent)

    def _begin_step(self, now: float) -> None:
        """Begin the step of the newest sensors if the cell's inputs are complete."""
        if self._readings is None or not self.joined:
            return
        if newly_silent := tuple(self.awaited):
            # In the first steps neighbours may not have discovered each other yet.
            patience = self._patience if self.step >= START_STEPS else 10.0 * self._patience
            if not patience or now - self.since < patience:
                return
            self._inbox.silent.update(newly_silent)
        messages = self._inbox.take(self.step - 1)
        self.cell.begin_step(self.step, self._readings, messages, now)
        self._readings, self._newly_silent = None, newly_silent

    @property
    def usual(self) -> bool:
        """Return whether the next step needs nothing but sensors and all neighbours' messages."""
        return self.joined and not (self.unanswered or self._inbox.silent)

    def received(self) -> dict[int, np.ndarray]:
        """Return the messages of the present step that have arrived already, by direction."""
        return self._inbox.received(self.step)

    def note_usual_step(self, now: float) -> None:
        """Record that the caller has made the next step, with all messages on time."""
        self._inbox.note_all_on_time(self.episode, self.step)
        self.step, self.since = self.step + 1, now
        self.sensors_delivery.arrive(self.step)
