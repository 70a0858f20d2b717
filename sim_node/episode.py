"""Names of a simulation's episodes, which encode the physics, and frame_ids that contain them."""

import re
import secrets

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.physics import UNNAMED_PHYSICS

EXAMPLE_EPISODE = b'EPISODE.'

UNKNOWN_PHYSICS = 'unknown'
"""The physics of an episode whose name has no known form."""

_LENGTH = len(EXAMPLE_EPISODE)
_INITIALS = {'reference': 'r', 'first': ''}
"""First letter of an episode's name by physics: all different, none a hexadecimal digit."""


def new_episode(physics: str) -> np.ndarray:
    """Return a new random name of an episode, (8,) uint8 of ASCII.

    It is the initial of the physics, followed by hexadecimal digits. The simulation draws a name
    whenever it starts or is reset. Messages of sensors have it in their frame_id,
    `<voxel>@<episode>`, those of the applied actuation as `<robot>@<episode>`, and voxels copy it
    into all their messages, so that receivers can discard messages of other episodes and
    simulations.

    Args:
        physics: one of `sim_node.model.physics.PHYSICS`.
    """
    name = (_INITIALS[physics] + secrets.token_hex(_LENGTH))[:_LENGTH]
    return np.frombuffer(name.encode(), np.uint8)


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
