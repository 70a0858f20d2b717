"""Ctrl-C while a command starts, before it has anything to finish."""

import contextlib
import signal
from collections.abc import Iterator


@contextlib.contextmanager
def interrupt_ends_at_once() -> Iterator[None]:
    """Let Ctrl-C end this process without a traceback, as long as it only imports and parses.

    An exception in the middle of an import could become any other error. Where Ctrl-C is ignored,
    as in a background process, or handled otherwise, this is left so.
    """
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    try:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    except ValueError:  # not the main thread, which alone receives it
        yield
        return
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)
