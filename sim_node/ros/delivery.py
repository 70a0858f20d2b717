"""What came over the links between nodes, by control step: on time, late, or lost."""

_MEMORY = 1000  # missing steps that may still come late


class Link:
    """The account of one link.

    Attributes:
        on_time: messages that were there when they were needed.
        late: messages that came after that.
        lost: messages that have not come so far.
        newest: newest step whose message was on time; -1 if none was.
    """

    def __init__(self) -> None:
        self.on_time = self.late = self.lost = 0
        self.restart()

    def restart(self) -> None:
        """Begin an episode: nothing that was missing before can come late any more."""
        self.newest = -1
        self._missing: dict[int, None] = {}  # in the order in which they were missed

    def close_step(self, step: int, came: bool) -> None:
        """Note whether the message of a step is there, now that it is needed."""
        if came:
            self.on_time += 1
            self.newest = step
            return
        self.lost += 1
        self._missing[step] = None
        if len(self._missing) > _MEMORY:
            del self._missing[next(iter(self._missing))]

    def arrive(self, step: int) -> None:
        """Note that a message has come, and none of those between it and the newest before."""
        for missing in range(self.newest + 1, step) if self.newest >= 0 else ():
            self.close_step(missing, False)
        self.close_step(step, True)

    def note_late(self, step: int) -> None:
        """Note that the message of a step has come after its step was closed."""
        if step in self._missing:
            del self._missing[step]
            self.lost -= 1
            self.late += 1

    def counts(self) -> dict[str, int]:
        """Return the account by name."""
        return {'on time': self.on_time, 'late': self.late, 'lost': self.lost}


def link_figures(links: dict[str, Link]) -> dict[str, int]:
    """Return what /diagnostics shows of links: `<topic> on time`, `... late` and `... lost`."""
    return {
        f'{topic} {outcome}': count
        for topic, link in links.items() for outcome, count in link.counts().items()
    }
