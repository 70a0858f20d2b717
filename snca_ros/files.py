"""Files: written so that no reader sees half of one, folders held, YAML read, room for bags."""

import contextlib
import fcntl
import os
import resource
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, TextIO

import yaml

from sim_node.errors import InvalidInput

LOCK = '.lock'
"""A file in a folder that one process at a time works on."""

RESERVE = 16_000_000
"""Bytes that must stay free where a bag grows: more than it grows by in a second, and its end."""

RUNS, RESULTS = Path('runs'), Path('results')
"""Folders of runs and of the results of campaigns, unless others are given."""

FIGURE, PAGE = 'report.png', 'replay.html'
"""Files that are written into the folder of a bag or run, unless others are given."""


def write_atomically(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Create or replace `path` with what `write` puts into a binary file.

    The file appears whole or, on any error or kill, not at all (the old one stays).
    """
    path = Path(path)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f'.{path.name}.', suffix='.tmp')
    try:
        with os.fdopen(handle, 'wb') as file:
            write(file)
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, 0o644)
        os.replace(name, path)
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(name)
        raise


def write_text(path: Path, text: str) -> None:
    """Create or replace `path` with `text`, atomically."""
    write_atomically(path, lambda file: file.write(text.encode()))


def check_writable(field: str, path: Path) -> None:
    """Check that `path` can be written, before the work whose result it is to hold.

    Raises:
        InvalidInput: it is a folder, or its folder is missing or closed to us; names `field`.
    """
    reason = 'Is a directory' if path.is_dir() else ''
    if not reason:
        try:
            tempfile.TemporaryFile(dir=path.parent).close()
        except OSError as error:
            reason = reason_of(error)
    if reason:
        raise InvalidInput(field, reason, 'a file that can be written', str(path))


def reason_of(error: Exception) -> str:
    """Return why a file could not be read, in one line and without its name."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return ' '.join(str(error).split())


def hold_folder(path: Path, what: str, wait: bool = False) -> TextIO:
    """Hold the folder `path` against other processes until the file returned is closed.

    What a process left half-written that was killed in it is cleared away.

    Args:
        path: of the folder, which exists.
        what: it is, for the error.
        wait: for a process that holds it.

    Raises:
        InvalidInput: another process holds it.
        OSError: it cannot be written.
    """
    lock = (path / LOCK).open('w')
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except OSError:
        lock.close()
        expected = f'a {what} folder that no other process is working on'
        raise InvalidInput(what, 'one in use', expected, str(path)) from None
    for left in path.rglob('.*.tmp'):
        left.unlink(missing_ok=True)
    return lock


def read_yaml(path: Path, expected: str) -> Any:
    """Return what the YAML file at `path` holds; InvalidInput if it cannot be read."""
    try:
        return yaml.safe_load(path.read_text())
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise InvalidInput('file', reason_of(error), expected, str(path)) from None


def check_new_bag(folder: Path) -> None:
    """Check that a bag can be made and has room to grow.

    Raises:
        InvalidInput: the folder exists or cannot be made, or less than `RESERVE` is free.
    """
    if folder.exists():
        raise InvalidInput('bag', str(folder), 'a folder that does not exist yet')
    parent = next(parent for parent in folder.absolute().parents if parent.exists())
    try:
        tempfile.TemporaryDirectory(dir=parent, prefix='.snca_ros_').cleanup()
    except OSError as error:
        expected = f'a folder that can be written ({error.strerror})'
        raise InvalidInput('bag', str(folder), expected) from None
    if (room := room_for(parent)) < RESERVE:
        expected = f'at least {RESERVE / 1e6:.0f} MB'
        raise InvalidInput('bag', f'room for {room / 1e6:.1f} MB', expected, str(folder))


def room_for(path: Path) -> int:
    """Return by how many bytes a file may grow, or a file made in a folder."""
    disk = os.statvfs(path)
    limit, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
    free = disk.f_bavail * disk.f_frsize
    if limit == resource.RLIM_INFINITY:
        return free
    return min(free, limit - (path.stat().st_size if path.is_file() else 0))
