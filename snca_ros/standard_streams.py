"""Prepares the standard streams: closed ones, and characters that they cannot encode."""

import codecs
import contextlib
import io
import os
import sys

_PLAIN = {
    **dict.fromkeys('–·', '-'), '±': '+/-', '×': 'x', '…': '...', '→': '->',
    **dict(zip('▁▂▃▄▅▆▇█', '_.:-=+*#', strict=True)),
}
"""ASCII text for characters in the output of commands."""

_ERRORS = 'snca_ros.plain_text'


def prepare_streams() -> None:
    """Make sure that printing never fails because a stream is closed or cannot encode a character.

    A closed stream becomes /dev/null; otherwise the next file that is opened would get its
    descriptor, and its output. A character that a stream cannot encode is replaced by similar ASCII
    text, or else by its escape sequence, as in names of files that are not UTF-8.
    """
    codecs.register_error(_ERRORS, _plain_text)
    for descriptor, name in enumerate(('stdin', 'stdout', 'stderr')):
        _open_descriptor(descriptor)
        stream = getattr(sys, name)
        if stream is None:
            # Closed at the end of the process, like the standard streams.
            setattr(sys, name, open(os.devnull, 'w' if descriptor else 'r'))  # noqa: SIM115
        elif descriptor and isinstance(stream, io.TextIOWrapper) and stream.errors != _ERRORS:
            stream.reconfigure(errors=_ERRORS)


def _open_descriptor(descriptor: int) -> None:
    """Open /dev/null at a standard descriptor, also for child processes, if it is closed."""
    try:
        os.fstat(descriptor)
    except OSError:
        opened = os.open(os.devnull, os.O_RDWR)
        if opened == descriptor:
            os.set_inheritable(descriptor, True)
        else:
            os.dup2(opened, descriptor)
            os.close(opened)


def _plain_text(error: UnicodeError) -> tuple[str, int]:
    """Return replacements of the characters that cannot be encoded, and where to go on."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    escape = lambda c: c.encode('ascii', 'backslashreplace').decode()  # noqa: E731
    return ''.join(_PLAIN.get(c) or escape(c) for c in text), error.end


def write_error(text: str) -> None:
    """Print a line on standard error, or nothing if nobody can read it."""
    with contextlib.suppress(OSError):
        print(text, file=sys.stderr, flush=True)


def discard_unwritable() -> None:
    """Flush the output; discard what nobody can read, so that the process ends without an error."""
    for stream in (sys.stdout, sys.stderr):
        try:
            stream.flush()
        except (OSError, ValueError):
            with contextlib.suppress(OSError, ValueError):
                os.dup2(os.open(os.devnull, os.O_WRONLY), stream.fileno())
