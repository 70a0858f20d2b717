"""Episodes of a simulation: their names, which say by which physics the body moves."""

import re
import secrets

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.physics import UNNAMED_PHYSICS

EXAMPLE_EPISODE = b'EPISODE.'

UNKNOWN_PHYSICS = 'unknown'
"""What episodes have whose name this version does not understand."""

_LENGTH = len(EXAMPLE_EPISODE)
_INITIALS = {'reference': 'r', 'first': ''}
"""What names of episodes begin with, by physics; no two the same, none a hexadecimal digit."""


def new_episode(physics: str) -> np.ndarray:
    """Return a name that no other episode has, (8,) uint8 of ASCII.

    It is what `_INITIALS` has for the physics, filled up with hexadecimal digits. The simulation
    draws a name whenever it starts or is reset. Sensors carry it in their frame_id,
    `<voxel>@<episode>`, and voxels repeat it in whatever they say in answer: nobody takes a
    message of another episode, or of another simulation, for one of this.

    Args:
        physics: one of `sim_node.model.physics.PHYSICS`.
    """
    name = (_INITIALS[physics] + secrets.token_hex(_LENGTH))[:_LENGTH]
    return np.frombuffer(name.encode(), np.uint8)


def physics_of_episode(name: bytes) -> str:
    """Return the physics of an episode, by its name; `UNKNOWN_PHYSICS` if it is of no known form.

    The name is empty in bags that are older than the names of episodes.
    """
    if not name:
        return UNNAMED_PHYSICS
    for physics, initial in _INITIALS.items():
        digits = _LENGTH - len(initial)
        if re.fullmatch(rf'{initial}[0-9a-f]{{{digits}}}'.encode(), name):
            return physics
    return UNKNOWN_PHYSICS


def frame_of(voxel: str, episode: bytes = EXAMPLE_EPISODE) -> str:
    """Return the frame_id of what concerns a voxel in an episode."""
    return f'{voxel}@{episode.decode()}'


def episode_of(frame: str) -> bytes:
    """Return the name of the episode in a frame_id; empty if there is none."""
    return frame.partition('@')[2].encode()


def check_frame(voxel: str, frame: str) -> None:
    """Raise InvalidInput if `frame` is not the voxel's in any episode."""
    place, _, episode = frame.rpartition('@')
    if place != voxel or len(episode.encode()) != _LENGTH:
        raise InvalidInput('frame_id', frame, frame_of(voxel, b'<digits>'))
