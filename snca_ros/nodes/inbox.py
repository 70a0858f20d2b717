"""Buffers the messages of a neighbour until the control step that needs them."""

from collections import deque
from collections.abc import Callable

import numpy as np

_MAX_OTHERS = 16  # messages of other episodes that are kept; in lock-step one would be enough
_MAX_PAST = 16  # names of past episodes that are kept


class MessageBuffer:
    """The unused messages of one neighbour, by episode and control step.

    Only the first message for a step is kept; messages for past steps and past episodes are
    dropped. A few messages of other episodes are kept, first those that may begin, with the lowest
    steps: a new episode begins at step 0, and a neighbour may receive its first sensors before this
    voxel does.

    Args:
        may_begin: returns whether the simulation of another episode exists.
    """

    def __init__(self, may_begin: Callable[[bytes], bool]) -> None:
        self._may_begin = may_begin
        self._messages: dict[tuple[bytes, int], np.ndarray] = {}
        self._past: deque[bytes] = deque(maxlen=_MAX_PAST)
        self._episode, self._step = b'', 0

    def advance_to(self, episode: bytes, step: int) -> None:
        """Set the current episode and step, and drop the messages for earlier steps."""
        if episode != self._episode:
            self._past.append(self._episode)
            if episode in self._past:  # of the only simulation that is left
                self._past.remove(episode)
        self._episode, self._step = episode, step
        for key in [key for key in self._messages if self._is_past(*key)]:
            del self._messages[key]

    def _is_past(self, episode: bytes, step: int) -> bool:
        return episode in self._past or (episode == self._episode and step < self._step)

    def put(self, episode: bytes, step: int, message: np.ndarray) -> bool:
        """Keep a message unless it is late or repeated; return whether it was neither."""
        if self._is_past(episode, step) or (episode, step) in self._messages:
            return False
        self._messages[episode, step] = message
        others = [key for key in self._messages if key[0] != self._episode]
        if len(others) > _MAX_OTHERS:
            kept = {name: self._may_begin(name) for name in {name for name, _ in others}}
            del self._messages[max(others, key=lambda key: (not kept[key[0]], key[1]))]
        return True

    def __contains__(self, step: int) -> bool:
        """Return whether the message for a step of the current episode is in the buffer."""
        return (self._episode, step) in self._messages

    def pop(self, step: int) -> np.ndarray | None:
        """Remove and return the message for a step of the current episode; None if it is absent."""
        return self._messages.pop((self._episode, step), None)
