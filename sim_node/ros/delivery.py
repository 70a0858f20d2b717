"""Delivery statistics of messages between nodes: numbers on time, late, and lost."""

_MEMORY = 1000  # missing messages per sender that can still count as late


class Delivery:
    """Delivery statistics of the messages of one sender, one message per control step.

    Attributes:
        on_time: number of messages that arrived before they were needed.
        late: number of messages that arrived after that.
        lost: number of messages that have not arrived.
        newest: newest step whose message was on time; -1 if there is none.
    """

    def __init__(self) -> None:
        self.on_time = self.late = self.lost = 0
        self.restart()

    def restart(self) -> None:
        """Begin an episode: messages missing from the one before can no longer count as late."""
        self.newest = -1
        self._missing: dict[int, None] = {}  # an ordered set of steps

    def close_step(self, step: int, arrived: bool) -> None:
        """Record, when the message of a step is needed, whether it has arrived."""
        if arrived:
            self.on_time += 1
            self.newest = step
            return
        self.lost += 1
        self._missing[step] = None
        if len(self._missing) > _MEMORY:
            del self._missing[next(iter(self._missing))]

    def arrive(self, step: int) -> None:
        """Record the arrival of a message; those between it and the newest one count as lost."""
        for missing in range(self.newest + 1, step) if self.newest >= 0 else ():
            self.close_step(missing, False)
        self.close_step(step, True)

    def note_late(self, step: int) -> None:
        """Record that the message of a step has arrived after `close_step`."""
        if step in self._missing:
            del self._missing[step]
            self.lost -= 1
            self.late += 1

    def counts(self) -> dict[str, int]:
        """Return the number of messages by outcome."""
        return {'on time': self.on_time, 'late': self.late, 'lost': self.lost}


def delivery_statistics(deliveries: dict[str, Delivery]) -> dict[str, int]:
    """Return the values for /diagnostics: `<topic> on time`, `<topic> late`, `<topic> lost`."""
    return {
        f'{topic} {outcome}': count
        for topic, delivery in deliveries.items() for outcome, count in delivery.counts().items()
    }
