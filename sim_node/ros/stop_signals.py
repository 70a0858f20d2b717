"""Handling of SIGINT and SIGTERM without exceptions, which could be lost."""

import os
import signal
from collections.abc import Iterator
from contextlib import contextmanager

STOP_SIGNALS = (signal.SIGINT, signal.SIGTERM)
"""Signals that ask a process to end."""


def exit_at_stop_signals(code: int) -> None:
    """From now on, end this process with `code` at once when it is asked to end.

    For processes that have nothing to finish yet. `KeyboardInterrupt` would not do: what is raised
    in callbacks and finalisers, of which imports have many, is ignored.
    """
    def end(number: int, frame: object) -> None:
        os._exit(code)

    for number in STOP_SIGNALS:
        signal.signal(number, end)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, STOP_SIGNALS)


@contextmanager
def blocked_stop_signals() -> Iterator[None]:
    """Block the signals in this thread: they are delivered afterwards."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, STOP_SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


class StopRequest:
    """Notes the signals from its creation on, unless they are ignored like in a background job.

    Attributes:
        requested: whether the process has been asked to end.
    """

    def __init__(self) -> None:
        self.requested = False
        self._before = {
            number: signal.signal(number, self._note) for number in STOP_SIGNALS
            if signal.getsignal(number) is not signal.SIG_IGN
        }

    def _note(self, number: int, frame: object) -> None:
        self.requested = True

    def raise_if_requested(self) -> None:
        """Raise KeyboardInterrupt if the process has been asked to end."""
        if self.requested:
            raise KeyboardInterrupt

    def __enter__(self) -> 'StopRequest':
        return self

    def __exit__(self, *exc_info: object) -> None:
        """Restore the handlers."""
        for number, handler in self._before.items():
            signal.signal(number, handler)
