"""Files: atomic writing, locked folders, YAML, and free space for bags."""

import contextlib
import csv
import fcntl
import os
import resource
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, BinaryIO, TextIO

import yaml

from sim_node.errors import InvalidInput
from snca_ros.standard_streams import write_error

LOCK = '.lock'
"""Name of the lock file in folders that only one process at a time may use."""

RESERVE = 16_000_000
"""Bytes that must stay free for a bag: for more than a second of recording, and for closing it."""

RUNS, RESULTS, BAGS = Path('runs'), Path('results'), Path('bags')
"""Default folders of runs, of the results of campaigns, and of bags."""

FIGURE, PAGE = 'report.png', 'replay.html'
"""Default names of files in the folder of a bag or run."""


def write_atomically(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Create or replace the file `path`; `write` writes its content into a binary file.

    After an error or a kill, the old file is unchanged.
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
    write_atomically(path, lambda file: file.write(text.encode(errors='backslashreplace')))


def check_writable(field: str, path: Path) -> None:
    """Check that the file `path` can be written, before its content is computed.

    Raises:
        InvalidInput: it is a folder, or its folder is missing or not writable; names `field`.
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
    """Return the reason why a file could not be read, as one line without its name."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return ' '.join(str(error).split())


def hold_folder(path: Path, what: str, wait: bool = False) -> TextIO:
    """Lock the folder `path` against other processes until the returned file is closed.

    Temporary files of processes that were killed are removed.

    Args:
        path: path of an existing folder.
        what: kind of the folder, for the error.
        wait: whether to wait while another process holds the lock.

    A folder on a file system without locks can be used, with a warning on standard error.

    Raises:
        InvalidInput: another process holds the lock.
        OSError: the folder cannot be written.
    """
    lock = (path / LOCK).open('w')
    try:
        fcntl.flock(lock, fcntl.LOCK_EX | (0 if wait else fcntl.LOCK_NB))
    except (BlockingIOError, PermissionError):
        lock.close()
        expected = f'a {what} folder that no other process is working on'
        raise InvalidInput(what, 'a folder in use', expected, str(path)) from None
    except OSError as error:
        write_error(
            f'warning: {path} cannot be locked ({reason_of(error)}): make sure that no other '
            'process works on this folder'
        )
    for left in path.rglob('.*.tmp'):
        left.unlink(missing_ok=True)
    return lock


def read_yaml(path: Path, expected: str) -> Any:
    """Return the content of the YAML file at `path`; InvalidInput if it cannot be read."""
    try:
        return yaml.safe_load(path.read_text())
    except (OSError, ValueError, RecursionError, yaml.YAMLError) as error:
        raise InvalidInput('file', reason_of(error), expected, str(path)) from None


def read_csv(path: Path, expected: str) -> tuple[list[str], list[list[str]]]:
    """Return the header and the other rows of a CSV file.

    Raises:
        InvalidInput: there is none, it cannot be read, or it is damaged; `expected` says what is
            expected.
    """
    try:
        with path.open(newline='') as file:
            header, *rows = csv.reader(file, strict=True)
    except (OSError, ValueError, csv.Error) as error:
        raise InvalidInput('file', reason_of(error), expected, str(path)) from None
    return header, rows


NOT_IN_SQLITE = frozenset('?#%')
"""Characters of a path that rosbags takes for parts of a URI, if the storage is sqlite3."""


def check_new_bag(folder: Path, storage: str) -> None:
    """Check that the folder of a bag can be created and that there is enough free space.

    Raises:
        InvalidInput: the folder exists or cannot be created, the storage cannot write to such a
            path, or less than `RESERVE` is free.
    """
    if folder.exists():
        raise InvalidInput('bag', str(folder), 'a folder that does not exist yet')
    if storage == 'sqlite3' and NOT_IN_SQLITE.intersection(str(folder.absolute())):
        expected = f'a path without {" ".join(sorted(NOT_IN_SQLITE))}, or the storage mcap'
        raise InvalidInput('bag', str(folder), expected)
    parent = next(parent for parent in folder.absolute().parents if parent.exists())
    try:
        tempfile.TemporaryDirectory(dir=parent, prefix='.snca_ros_').cleanup()
    except OSError as error:
        expected = f'a folder that can be written ({error.strerror})'
        raise InvalidInput('bag', str(folder), expected) from None
    if (room := room_for(parent)) < RESERVE:
        expected = f'at least {RESERVE / 1e6:.0f} MB'
        raise InvalidInput('bag', f'{room / 1e6:.1f} MB of free space', expected, str(folder))


def room_for(path: Path) -> int:
    """Return how many bytes a file can grow by, or a new file in a folder."""
    disk = os.statvfs(path)
    limit, _ = resource.getrlimit(resource.RLIMIT_FSIZE)
    free = disk.f_bavail * disk.f_frsize
    if limit == resource.RLIM_INFINITY:
        return free
    return min(free, limit - (path.stat().st_size if path.is_file() else 0))
