"""Ctrl-C while a command starts, before it has anything to finish."""

import contextlib
import os
import signal
import threading
from collections.abc import Iterator

INTERRUPTED = 130
"""The exit code after Ctrl-C."""


@contextlib.contextmanager
def exiting_at_interrupt() -> Iterator[None]:
    """End the process at Ctrl-C at once in this block, whose code has nothing to finish.

    For imports and compiled code: a KeyboardInterrupt that is raised in one of their callbacks and
    finalisers would be ignored. Where Ctrl-C is ignored, as in a background process, or handled
    otherwise, this is left so.
    """
    before = signal.getsignal(signal.SIGINT)
    is_main = threading.current_thread() is threading.main_thread()  # which alone sets handlers
    if before is not signal.default_int_handler or not is_main:
        yield
        return
    signal.signal(signal.SIGINT, lambda number, frame: os._exit(INTERRUPTED))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
