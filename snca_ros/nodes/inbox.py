"""Messages of a neighbour that came before they were needed."""

from collections import deque

import numpy as np

_ROOM = 16  # messages of other episodes; in lock-step one would do
_EPISODES = 16  # past ones that are remembered


class Pending:
    """What one neighbour has said and nobody has used, by episode and step.

    The first word counts: what is said again, or for a step that is over, is not kept. Of other
    episodes there is room for a few messages only: one of them may be about to begin, at step 0.
    """

    def __init__(self) -> None:
        self._messages: dict[tuple[bytes, int], np.ndarray] = {}
        self._past: deque[bytes] = deque(maxlen=_EPISODES)
        self._now = b'', 0

    def turn_to(self, episode: bytes, step: int) -> None:
        """Expect messages of this step from now on; what came for those before is over."""
        if episode != self._now[0]:
            self._past.append(self._now[0])
        self._now = episode, step
        for key in [key for key in self._messages if self._is_over(*key)]:
            del self._messages[key]

    def _is_over(self, episode: bytes, step: int) -> bool:
        return episode in self._past or (episode == self._now[0] and step < self._now[1])

    def put(self, episode: bytes, step: int, message: np.ndarray) -> bool:
        """Keep a message; return whether it was neither late nor repeated."""
        if self._is_over(episode, step) or (episode, step) in self._messages:
            return False
        self._messages[episode, step] = message
        others = [key for key in self._messages if key[0] != self._now[0]]
        if len(others) > _ROOM:
            del self._messages[max(others, key=lambda key: key[1])]
        return True

    def __contains__(self, step: int) -> bool:
        """Tell whether the message of a step of this episode is here."""
        return (self._now[0], step) in self._messages

    def pop(self, step: int) -> np.ndarray | None:
        """Return the message of a step of this episode and forget it; None if it is not here."""
        return self._messages.pop((self._now[0], step), None)
