"""How far a long command is, told on standard error."""

import math
import sys
import time


class StatusLine:
    """On a terminal one line that changes; elsewhere a line every so many seconds."""

    def __init__(self, every: float = 10.0) -> None:
        self._every, self._shown = every, time.monotonic()
        self._live = sys.stderr.isatty()

    def show(self, text: str, last: bool = False) -> None:
        """Show `text` if it is time to, or if it is the last."""
        now = time.monotonic()
        if not (self._live or last or now - self._shown >= self._every):
            return
        self._shown = now
        end = '\n' if last or not self._live else ''
        print(f'\r\x1b[K{text}' if self._live else text, end=end, file=sys.stderr, flush=True)

    def clear(self) -> None:
        """Make room for another line."""
        if self._live:
            print('\r\x1b[K', end='', file=sys.stderr, flush=True)


class TimeLeft:
    """Foretells the end of so many evaluations from their rate since it was made."""

    def __init__(self, total: int, done: int) -> None:
        self.total, self._before, self._start = total, done, time.monotonic()

    def told(self, done: int) -> str:
        """Return evaluations/s and the time left as text."""
        rate = (done - self._before) / (time.monotonic() - self._start)
        if not rate > 0.0:
            return '0.0/s'
        seconds = math.ceil((self.total - done) / rate)
        left = f'{seconds // 3600}:{seconds // 60 % 60:02}:{seconds % 60:02}'
        return f'{rate:.1f}/s  {left} left'
