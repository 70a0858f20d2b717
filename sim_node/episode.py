"""Names of episodes, which encode physics and simulation, and frame_ids that contain them."""

import re
import secrets

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.physics import UNNAMED_PHYSICS

EXAMPLE_EPISODE = b'EPISODE.'

UNKNOWN_PHYSICS = 'unknown'
"""The physics of an episode whose name has no known form."""

_LENGTH = len(EXAMPLE_EPISODE)
_IDENTITY_BYTES = 2
_INITIALS = {'reference': 'r', 'first': ''}
"""First letter of an episode's name by physics: all different, none a hexadecimal digit."""


def new_identity() -> str:
    """Return a random identity of a simulation, four hexadecimal digits."""
    return secrets.token_hex(_IDENTITY_BYTES)


class EpisodeNames:
    """The names of the episodes of one simulation.

    A name is the initial of the physics, the identity of the simulation, and hexadecimal digits
    that change whenever the simulation is reset. Messages of sensors have it in their frame_id,
    `<voxel>@<episode>`, those of the applied actuation as `<robot>@<episode>`, and voxels copy it
    into all their messages, so that receivers can discard messages of other episodes and
    simulations.

    Args:
        physics: one of `sim_node.model.physics.PHYSICS`.
        identity: of the simulation, as from `new_identity`.
    """

    def __init__(self, physics: str, identity: str) -> None:
        self._begin = _INITIALS[physics] + identity
        self._n_digits = _LENGTH - len(self._begin)
        self._number = secrets.randbelow(16**self._n_digits)

    def next(self) -> np.ndarray:
        """Return the name of the next episode, (8,) uint8 of ASCII."""
        self._number = (self._number + 1) % 16**self._n_digits
        name = f'{self._begin}{self._number:0{self._n_digits}x}'
        return np.frombuffer(name.encode(), np.uint8)


def simulation_of_episode(name: bytes) -> str:
    """Return the identity of an episode's simulation; empty if the form of the name is not known.

    Names in old bags have the same form, but digits of no simulation.
    """
    physics = physics_of_episode(name)
    if not name or physics not in _INITIALS:
        return ''
    begin = len(_INITIALS[physics])
    return name[begin : begin + 2 * _IDENTITY_BYTES].decode()


def physics_of_episode(name: bytes) -> str:
    """Return the physics of an episode by its name; `UNKNOWN_PHYSICS` if the form is not known.

    Bags that are older than the names of episodes have an empty name.
    """
    if not name:
        return UNNAMED_PHYSICS
    for physics, initial in _INITIALS.items():
        digits = _LENGTH - len(initial)
        if re.fullmatch(rf'{initial}[0-9a-f]{{{digits}}}'.encode(), name):
            return physics
    return UNKNOWN_PHYSICS


def frame_of(sender: str, episode: bytes = EXAMPLE_EPISODE) -> str:
    """Return the frame_id of a voxel's or a robot's messages in an episode."""
    return f'{sender}@{episode.decode()}'


def episode_of(frame: str) -> bytes:
    """Return the name of the episode in a frame_id; empty if it has none."""
    return frame.partition('@')[2].encode()


def check_frame(sender: str, frame: str) -> None:
    """Raise InvalidInput if `frame` is not a frame_id of this voxel or robot, in any episode."""
    found, _, episode = frame.rpartition('@')
    if found != sender or len(episode.encode()) != _LENGTH:
        raise InvalidInput('frame_id', frame, frame_of(sender, b'<digits>'))
