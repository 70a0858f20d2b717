"""Deadlines of steps, statistics of step times, and the time that limits count, all in [s]."""

import time
from collections import deque
from collections.abc import Callable

import numpy as np

_LAG_LIMIT = 1.0
_GAP = 0.2
_WINDOW = 3600  # steps


class ListeningTime:
    """The time in which a process could listen, which limits on the silence of others count.

    A process that was stopped or did not get a processor finds messages in its queues when it runs
    again, and must not judge others by the interval before it has read them. So intervals of more
    than 0.2 s between two calls of `now` do not count; the owner calls it more often than that.

    Args:
        clock: returns a monotonic time.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock, self._last, self._counted = clock, clock(), 0.0

    def now(self) -> float:
        """Return the time since the object was made, without the intervals that do not count."""
        now = self._clock()
        interval, self._last = now - self._last, now
        if interval <= _GAP:
            self._counted += interval
        return self._counted


class Pace:
    """Absolute deadlines at a fixed rate, so that delays of single steps do not accumulate.

    A loop that is more than a second late skips the missed deadlines and continues from there.

    Args:
        rate: steps per second.

    Attributes:
        period: time between two steps.
        missed: number of steps that began when the next one was already due, and of skipped
            deadlines.
    """

    def __init__(self, rate: float) -> None:
        self.period = 1.0 / rate
        self.missed = 0
        self.start(0, 0.0)

    def start(self, step: int, now: float) -> None:
        """Start, or restart, the deadlines with `step` at time `now`."""
        self._first_step, self._start_time = step, now

    def due(self, step: int) -> float:
        """Return the deadline of a step."""
        return self._start_time + (step - self._first_step) * self.period

    def note(self, step: int, now: float) -> None:
        """Record that a step is made at time `now`."""
        lag = now - self.due(step)
        if lag > _LAG_LIMIT:
            self.missed += int(lag / self.period)
            self.start(step, now)
        elif lag >= self.period:
            self.missed += 1


class StepTimes:
    """Statistics of the time from one step to the next: median, 99th percentile and maximum.

    The percentiles cover the last 3600 steps, a minute in real time; the maximum covers all steps.
    """

    def __init__(self) -> None:
        self._times: deque[float] = deque(maxlen=_WINDOW)
        self._longest = 0.0
        self.restart()

    def restart(self) -> None:
        """Begin a new series of steps: the time since the last step does not count."""
        self._last: float | None = None

    def note(self, now: float) -> None:
        """Record that a step is made at time `now`."""
        if self._last is not None:
            self._times.append(now - self._last)
            self._longest = max(self._longest, now - self._last)
        self._last = now

    def summary(self) -> dict[str, str]:
        """Return the statistics [ms] by name; empty before the second step."""
        if not self._times:
            return {}
        median, high = np.percentile(self._times, [50, 99])
        statistics = {'p50': median, 'p99': high, 'max': self._longest}
        return {f'step time {name} [ms]': f'{1e3 * time:.2f}' for name, time in statistics.items()}
