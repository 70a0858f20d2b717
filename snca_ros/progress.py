"""Progress of long commands: status line, time left and text charts."""

import contextlib
import math
import os
import shutil
import sys
import time

import numpy as np

_BLOCKS = ' ▁▂▃▄▅▆▇█'


def bars(values: np.ndarray, width: int, height: int = 1) -> list[str]:
    """Return a bar chart of numbers as `height` lines of text, the upper one first.

    Args:
        values: (n,) numbers, n > 0; the lowest and those that are not finite have the lowest bar.
        width: number of characters; numbers are omitted or repeated evenly to fit.
        height: number of lines.
    """
    shown = np.linspace(0, len(values) - 1, width).round().astype(int)
    values = np.where(np.isfinite(values), values, np.nan)[shown]
    with np.errstate(invalid='ignore'):
        low, high = np.nanmin(values, initial=np.inf), np.nanmax(values, initial=-np.inf)
        share = np.nan_to_num((values - low) / (high - low))
    eighths = 1 + np.round(share * (8 * height - 1)).astype(int)
    return [
        ''.join(_BLOCKS[n] for n in np.clip(eighths - 8 * row, 0, 8))
        for row in reversed(range(height))
    ]


class StatusLine:
    """Progress on standard error: on a terminal a line that changes, else a line now and then.

    The cursor stays at the beginning of a line that changes, so that messages of other processes,
    such as nodes, overwrite it and begin a line. Call `clear` before other output of this process.

    Args:
        every: seconds between lines, if standard error is not a terminal.
    """

    def __init__(self, every: float = 60.0) -> None:
        self._every, self._shown = every, time.monotonic()
        self._live = sys.stderr.isatty()

    @property
    def width(self) -> int:
        """Return how many characters fit on a line; 0 if standard error is not a terminal."""
        return _columns() - 1 if self._live else 0

    def show(self, text: str, last: bool = False) -> None:
        """Show `text`, as much of it as fits on a line of the terminal, if it is due or the last.

        Args:
            text: the line.
            last: whether it is the last line.
        """
        now = time.monotonic()
        if not (self._live or last or now - self._shown >= self._every):
            return
        self._shown = now
        end = '\n' if last or not self._live else '\r'
        self._write(f'\r\x1b[K{fit(text, self.width)}{end}' if self._live else f'{text}{end}')

    def clear(self) -> None:
        """Remove the line from a terminal, so that other output can follow."""
        if self._live:
            self._write('\r\x1b[K')

    @staticmethod
    def _write(text: str) -> None:
        with contextlib.suppress(OSError):  # nobody can read it; the command goes on
            sys.stderr.write(text)
            sys.stderr.flush()


def fit(text: str, width: int) -> str:
    """Return the part of a line that fits into `width` characters, cut between its parts."""
    if len(text) <= width:
        return text
    ends = [text.rfind(separator, 0, width + 2) for separator in ('  ', ', ', '; ')]
    end = max(ends) if max(ends) > 0 else text.rfind(' ', 0, width + 1)
    return text[: end if end > 0 else width].rstrip()


def _columns() -> int:
    """Return the width of the terminal of standard error."""
    with contextlib.suppress(OSError, ValueError):
        if columns := os.get_terminal_size(sys.stderr.fileno()).columns:
            return columns
    return shutil.get_terminal_size().columns


class TimeLeft:
    """Estimates the time left of a number of episodes from their rate so far.

    Args:
        total: number of episodes.
        done: number of episodes that are done already.
    """

    def __init__(self, total: int, done: int) -> None:
        self.total, self._before, self._start = total, done, time.monotonic()

    def describe(self, done: int) -> str:
        """Return episodes/s and the time left as text."""
        rate = (done - self._before) / (time.monotonic() - self._start)
        if not rate > 0.0:
            return '0.0/s'
        seconds = math.ceil((self.total - done) / rate)
        left = f'{seconds // 3600}:{seconds // 60 % 60:02}:{seconds % 60:02}'
        return f'{rate:.1f}/s  {left} left'
