"""Files: atomic writing, locked folders, tables, and free space for bags."""

import contextlib
import csv
import errno
import fcntl
import hashlib
import io
import os
import re
import resource
import secrets
import stat
import sys
import tempfile
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import BinaryIO, TextIO

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

_TEMPORARY = re.compile(r'\A\..*\.snca-[0-9a-f]{16}\.tmp\Z', re.DOTALL)
_MOST_BYTES = 200  # of the target's name in a temporary file's; Linux allows 255 for all of it
_MOST_LINKS = 40  # that Linux follows


def write_atomically(path: Path, write: Callable[[BinaryIO], object]) -> None:
    """Create or replace the file `path`; `write` writes its content into a binary file.

    After an error or a kill, the old file is unchanged. Links are followed: their target is
    replaced. A replaced file keeps its mode and, as far as the process may set them, its owner and
    group; the umask gives the mode of a new file. What is no regular file (a device, a FIFO,
    /dev/stdout) is not replaced: the content is written into it.

    Raises:
        OSError: `path` cannot be written; names it.
    """
    content = io.BytesIO()
    write(content)
    try:
        descriptor, old = _descriptor_of(path), _status_of(path)
        if descriptor is not None:
            for stream in filter(None, (sys.stdout, sys.stderr)):
                stream.flush()
            _write_into(os.dup(descriptor), content)
        elif old is not None and not stat.S_ISREG(old.st_mode):
            _write_into(os.open(path, os.O_WRONLY | os.O_NOCTTY), content)
        else:
            _replace(os.path.realpath(path), content, old)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from None


def write_text(path: Path, text: str) -> None:
    """Create or replace `path` with `text`, atomically."""
    write_atomically(path, lambda file: file.write(text.encode(errors='backslashreplace')))


def _status_of(path: Path | str) -> os.stat_result | None:
    try:
        return os.stat(path)
    except FileNotFoundError:
        return None


def _descriptor_of(path: Path | str) -> int | None:
    """Return N if `path` is or leads to /proc/self/fd/N, such as /dev/stdout; else None."""
    for _ in range(_MOST_LINKS):
        folder, name = os.path.split(path)
        folder = os.path.realpath(folder)
        if folder == os.path.realpath('/proc/self/fd') and name.isdecimal():
            return int(name)
        path = os.path.join(folder, name)
        if not os.path.islink(path):
            break
        path = os.path.join(folder, os.readlink(path))
    return None


def _write_into(descriptor: int, content: io.BytesIO) -> None:
    with os.fdopen(descriptor, 'wb') as file:
        file.write(content.getbuffer())


def _replace(path: str, content: io.BytesIO, old: os.stat_result | None) -> None:
    """Write a temporary file, and give it the name `path` when its content is on the disk."""
    if old is not None:
        _check_access(path)
    folder, name = os.path.split(path)
    short = os.fsdecode(os.fsencode(name)[:_MOST_BYTES])
    temporary = os.path.join(folder, f'.{short}.snca-{secrets.token_hex(8)}.tmp')
    mode = 0o666 if old is None else 0o600
    descriptor = os.open(temporary, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
    try:
        with os.fdopen(descriptor, 'wb') as file:
            file.write(content.getbuffer())
            file.flush()
            if old is not None:
                _set_owner_and_mode(descriptor, old)
            os.fsync(descriptor)
        os.replace(temporary, path)
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            os.unlink(temporary)
        raise


def _check_access(path: Path | str) -> None:
    if not os.access(path, os.W_OK):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES))


def _set_owner_and_mode(descriptor: int, old: os.stat_result) -> None:
    """Give an open file the owner, the group and the permissions of the file that it replaces."""
    new = os.fstat(descriptor)
    if new.st_gid != old.st_gid:
        with contextlib.suppress(PermissionError):
            os.fchown(descriptor, -1, old.st_gid)
    if new.st_uid != old.st_uid:
        with contextlib.suppress(PermissionError):
            os.fchown(descriptor, old.st_uid, -1)
    os.fchmod(descriptor, old.st_mode & 0o777)


def short_name(name: str, most: int) -> str:
    """Return a name of at most `most` bytes: `name`, or its begin and a digest of it."""
    whole = name.encode()
    if len(whole) <= most:
        return name
    digest = hashlib.sha256(whole).hexdigest()[:16]
    return f'{whole[: most - len(digest) - 1].decode(errors="ignore")}-{digest}'


def remove_stale(folder: Path, names: Iterable[str]) -> None:
    """Remove temporary files that killed processes have left in a locked folder.

    Args:
        folder: the folder, in which no other process writes these files.
        names: names of the files that were to be written, relative to `folder`; may have wildcards.
    """
    for name in names:
        place, target = (folder / name).parent, Path(name).name
        for left in place.glob(f'.{target}.snca-*.tmp'):
            if is_temporary(left):
                left.unlink(missing_ok=True)


def is_temporary(path: Path) -> bool:
    """Return whether a path is a temporary file of `write_atomically`."""
    return _TEMPORARY.search(path.name) is not None and path.is_file() and not path.is_symlink()


def check_writable(field: str, path: Path) -> None:
    """Check that the file `path` can be written, before its content is computed.

    Raises:
        InvalidInput: it is a folder, or it or its folder is missing or not writable; names `field`.
    """
    if _descriptor_of(path) is not None:
        return
    try:
        old = _status_of(path)
        if old is not None and stat.S_ISDIR(old.st_mode):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        if old is not None:
            _check_access(path)
        if old is None or stat.S_ISREG(old.st_mode):
            tempfile.TemporaryFile(dir=os.path.dirname(os.path.realpath(path))).close()
    except OSError as error:
        expected = 'a file that can be written'
        raise InvalidInput(field, reason_of(error), expected, str(path)) from None


def reason_of(error: Exception) -> str:
    """Return the reason why a file could not be read, as one line without its name."""
    if isinstance(error, OSError) and error.strerror:
        return error.strerror
    return ' '.join(str(error).split())


def hold_folder(path: Path, what: str, wait: bool = False) -> TextIO:
    """Lock the folder `path` against other processes until the returned file is closed.

    Args:
        path: path of an existing folder.
        what: kind of the folder, for the error.
        wait: whether to wait while another process holds the lock.

    A folder on a file system without locks can be used, with a warning on standard error.

    Raises:
        InvalidInput: another process holds the lock.
        OSError: the folder cannot be written.
    """
    lock = (path / LOCK).open('a')
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
    return lock


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
    if storage == 'sqlite3' and NOT_IN_SQLITE.intersection(str(folder.absolute())):
        expected = f'a path without {" ".join(sorted(NOT_IN_SQLITE))}, or the storage mcap'
        raise InvalidInput('bag', str(folder), expected)
    try:
        if _status_of(folder) is not None:
            raise InvalidInput('bag', str(folder), 'a folder that does not exist yet')
        parent = next(parent for parent in folder.absolute().parents if parent.exists())
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
