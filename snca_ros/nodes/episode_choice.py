"""Decides whether the episode of received sensors is the voxel's next one.

This module does not import ROS.
"""

from collections import deque
from enum import Enum
from typing import NamedTuple, Protocol

import numpy as np

from sim_node.episode import simulation_of_episode

_MAX_PAST = 16  # names of past episodes that are kept
_SHOWN = 5.0  # seconds for which the diagnostics show sensors of another simulation


class SensorsResult(Enum):
    """Whether sensors were accepted; a value is the diagnostics' name of the counter."""

    ACCEPTED = 'accepted sensors'
    REPEATED = 'repeated sensors'
    PAST = 'sensors of a past episode'
    FOREIGN = 'sensors of another simulation'


class Simulations(Protocol):
    """What a voxel can find out about simulations, by their identities.

    See `sim_node.ros.simulations.Simulations`.
    """

    def is_live(self, identity: str) -> bool:
        """Return whether a simulation exists in the voxel's namespace."""

    def is_silent(self, identity: str) -> bool:
        """Return whether an existing simulation has not been heard for a while: it was killed."""


class Sensors(NamedTuple):
    """Sensors with the name of their episode, and when they arrived [s]."""

    episode: bytes
    step: int
    readings: np.ndarray
    now: float


class EpisodeChoice:
    """The current episode of a voxel, and which one may follow.

    As long as the simulation of the current episode exists, only its next episode may follow: a
    simulation that is reset goes on with a new episode. Sensors of another simulation are those of
    a bag that is played, of a second simulation, or of one that was started in place of one that
    was killed, which still seems to exist for a while. The newest of them are kept until theirs is
    the only simulation.

    Args:
        simulations: finds out which simulations exist. It is asked only about other episodes than
            the current one, which are rare.

    Attributes:
        episode: name of the current episode; empty before the first.
    """

    def __init__(self, simulations: Simulations) -> None:
        self._simulations = simulations
        self._past: deque[bytes] = deque(maxlen=_MAX_PAST)
        self._ignored: Sensors | None = None
        self.episode = b''

    def begin(self, episode: bytes) -> None:
        """Make another episode the current one."""
        self._past.append(self.episode)
        self.episode, self._ignored = episode, None

    def is_live(self, episode: bytes) -> bool:
        """Return whether the simulation of an episode exists."""
        identity = simulation_of_episode(episode)
        return bool(identity) and self._simulations.is_live(identity)

    def is_foreign(self, episode: bytes) -> bool:
        """Return whether another episode must not begin as the current simulation still exists."""
        mine, other = simulation_of_episode(self.episode), simulation_of_episode(episode)
        if mine == other or not self.is_live(self.episode):
            return False
        return not (self.is_live(episode) and self._simulations.is_silent(mine))

    def is_past(self, episode: bytes) -> bool:
        """Return whether an episode is over; one of the only simulation that exists is not."""
        same = simulation_of_episode(self.episode) == simulation_of_episode(episode)
        return episode in self._past and (same or not self.is_live(episode))

    def ignore(self, sensors: Sensors) -> None:
        """Keep sensors of another simulation, unless those of one that exists are kept."""
        kept = self._ignored
        if kept is None or not self.is_live(kept.episode) or self.is_live(sensors.episode):
            self._ignored = sensors

    def take_ignored(self) -> Sensors | None:
        """Return the sensors that were ignored if theirs is the only simulation now."""
        kept = self._ignored
        if kept is None or not self.is_live(kept.episode) or self.is_foreign(kept.episode):
            return None
        self._ignored = None
        return kept

    def ignores(self, now: float) -> bool:
        """Return whether there are sensors of another simulation that are not used.

        Args:
            now: the time [s].
        """
        kept = self._ignored
        return kept is not None and (now - kept.now < _SHOWN or self.is_live(kept.episode))
