"""Buffers the messages of the neighbours until the control step that needs them."""

from collections import deque
from collections.abc import Callable, Iterable

import numpy as np

from sim_node.model.morphology import OPPOSITE
from sim_node.ros.delivery import Delivery

_MAX_OTHERS = 16  # messages of other episodes that are kept; in lock-step one would be enough
_MAX_PAST = 16  # names of past episodes that are kept
_OVERDUE_STEPS = 15  # steps without a message after which the diagnostics name a neighbour


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

    def get(self, step: int) -> np.ndarray | None:
        """Return the message for a step of the current episode; None if it is absent."""
        return self._messages.get((self._episode, step))

    def pop(self, step: int) -> np.ndarray | None:
        """Remove and return the message for a step of the current episode; None if it is absent."""
        return self._messages.pop((self._episode, step), None)


class Inbox:
    """The messages of all neighbours of a voxel, on time or not.

    Args:
        directions: indices of DIRECTIONS in which the voxel has neighbours.
        directional: whether a message has a part for each direction.
        empty: an inbox without messages, zeros of shape (4, n_c, width).
        may_begin: as for `MessageBuffer`.

    Attributes:
        silent: directions of the neighbours that the voxel no longer waits for.
        deliveries: counts of messages on time, late and lost, by direction.
    """

    def __init__(
        self, directions: Iterable[int], directional: bool, empty: np.ndarray,
        may_begin: Callable[[bytes], bool],
    ) -> None:
        self._directional, self._messages = directional, empty
        self._buffers = {d: MessageBuffer(may_begin) for d in directions}
        self.silent: set[int] = set()
        self.deliveries = {d: Delivery() for d in self._buffers}

    def restart(self) -> None:
        """Begin an episode; messages that neighbours have sent in it already are kept."""
        self.silent.clear()
        for delivery in self.deliveries.values():
            delivery.restart()

    def advance_to(self, episode: bytes, step: int) -> None:
        """Set the current episode and step, and drop the messages for earlier steps."""
        for buffer in self._buffers.values():
            buffer.advance_to(episode, step)

    def put(self, direction: int, episode: bytes, step: int, message: np.ndarray) -> bool:
        """Keep a message unless it is late or repeated; return whether it was neither."""
        return self._buffers[direction].put(episode, step, message)

    def note_arrival(self, direction: int, step: int) -> None:
        """Record that a neighbour has sent a message of the current episode: it is not silent."""
        self.deliveries[direction].note_late(step)
        self.silent.discard(direction)

    def missing(self, step: int) -> list[int]:
        """Return the directions from which a message of `step` is awaited and has not arrived.

        A neighbour that has sent a message of the next step is not awaited: it was killed while it
        published, and restarted.
        """
        return [
            d for d, buffer in self._buffers.items()
            if step not in buffer and step + 1 not in buffer and d not in self.silent
        ]

    def overdue(self, step: int) -> list[int]:
        """Return the directions from which no message was on time in the last 15 steps."""
        return [
            d for d, delivery in self.deliveries.items()
            if step - delivery.newest > _OVERDUE_STEPS
        ]

    def take(self, step: int) -> np.ndarray:
        """Remove and return the messages of a step for the cell, (4, n_c, width).

        Those that have not arrived are 0. Before step 0 there are none.
        """
        for d, buffer in self._buffers.items():
            message = buffer.pop(step)
            if step >= 0:
                self.deliveries[d].close_step(step, message is not None)
            if message is None:
                self._messages[d] = 0.0
            else:
                self._messages[d] = message[OPPOSITE[d] if self._directional else 0]
        return self._messages

    def received(self, step: int) -> dict[int, np.ndarray]:
        """Return the messages of a step that have arrived, by direction."""
        found = {d: buffer.get(step) for d, buffer in self._buffers.items()}
        return {d: message for d, message in found.items() if message is not None}

    def note_all_on_time(self, episode: bytes, step: int) -> None:
        """Record that the caller has used all messages of a step, and advance to that step."""
        for d, buffer in self._buffers.items():
            self.deliveries[d].close_step(step, True)
            buffer.advance_to(episode, step)
