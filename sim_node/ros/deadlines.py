"""Keeping a rate on the monotonic clock, and how well it was kept. All times in seconds."""

from collections import deque

import numpy as np

_LAG_LIMIT = 1.0
_WINDOW = 3600  # steps


class Pace:
    """Absolute deadlines: what a step loses, the next ones make up for, and nothing drifts.

    A loop that is more than a second behind gives up what it has lost and goes on from there.

    Args:
        rate: steps per second.

    Attributes:
        period: time between two steps.
        missed: steps that began only when the next one was due already, and deadlines given up.
    """

    def __init__(self, rate: float) -> None:
        self.period = 1.0 / rate
        self.missed = 0
        self.start(0, 0.0)

    def start(self, step: int, now: float) -> None:
        """Let `step` be the one that is made now."""
        self._first, self._begin = step, now

    def due(self, step: int) -> float:
        """Return when a step is to be made."""
        return self._begin + (step - self._first) * self.period

    def note(self, step: int, now: float) -> None:
        """Note that a step is made now."""
        lag = now - self.due(step)
        if lag > _LAG_LIMIT:
            self.missed += int(lag / self.period)
            self.start(step, now)
        elif lag >= self.period:
            self.missed += 1


class StepTimes:
    """The time from one step to the next: median, 99th percentile and maximum.

    The percentiles are those of the last 3600 steps, a minute of real time; the maximum is that
    of all steps.
    """

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=_WINDOW)
        self._longest = 0.0
        self.restart()

    def restart(self) -> None:
        """Begin or interrupt the series of steps: what lies between is no step's time."""
        self._last: float | None = None

    def note(self, now: float) -> None:
        """Note that a step is made now."""
        if self._last is not None:
            self._times.append(now - self._last)
            self._longest = max(self._longest, now - self._last)
        self._last = now

    def summary(self) -> dict[str, str]:
        """Return the figures by name [ms]; empty before the second step."""
        if not self._times:
            return {}
        median, high = np.percentile(self._times, [50, 99])
        figures = {'p50': median, 'p99': high, 'max': self._longest}
        return {f'step time {name} [ms]': f'{1e3 * time:.2f}' for name, time in figures.items()}
