"""The folder of the cache of compiled code.

Numba recompiles a function when its own file changes, but not when a function that it calls, a
constant from another module, or a library changes. So the folder is named by a digest of all of
these; numba itself adds the processor to the key of every function.
"""

import functools
import hashlib
import os
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterator
from importlib import metadata
from pathlib import Path

from sim_node.numerics.source_digest import ROOT, sources

_DEPENDENCIES = 'numba', 'llvmlite', 'numpy', 'pymunk'
_NAME = re.compile(r'[0-9a-f]{16}')
_USED, _DAY, _KEPT = 'used', 86_400.0, 30 * 86_400.0  # name of the stamp file; seconds


@functools.cache
def folder() -> Path | None:
    """Return the folder of compiled code for the sources and libraries as they are now.

    It is below NUMBA_CACHE_DIR or XDG_CACHE_HOME, if one is set. Else it is below ~/.cache or, if
    that cannot be written or HOME names no folder, in the folder for temporary files. Folders of
    other versions that no process has used for 30 days are removed.

    Returns:
        The folder, which exists and is writable. None if there is no such folder: every process
        then compiles, and a message on standard error reports it once.
    """
    parents, name = _parents(), _digest()
    errors: list[OSError] = []
    for parent in parents:
        try:
            _open(parent, parent / name)
        except OSError as error:
            errors.append(error)
            continue
        for old in _unused(parent):
            shutil.rmtree(old, ignore_errors=True)
        return parent / name
    print(
        f'{parents[0] / name}: {errors[0].strerror}: compiled code cannot be kept: this process '
        'has to compile for about a minute; set XDG_CACHE_HOME to a writable folder',
        file=sys.stderr,
    )
    return None


def _parents() -> list[Path]:
    """Return the folders that may hold the folders of compiled code of all versions."""
    for variable in ('NUMBA_CACHE_DIR', 'XDG_CACHE_HOME'):
        if os.environ.get(variable):
            return [Path(os.environ[variable], 'snca_ros').absolute()]
    home = os.environ.get('HOME', os.path.expanduser('~'))
    of_home = [Path(home, '.cache', 'snca_ros')] if is_folder(home) else []
    return [*of_home, Path(tempfile.gettempdir(), f'snca_ros-{os.getuid()}')]


def is_folder(path: str) -> bool:
    """Return whether `path` is the absolute path of a folder; HOME may be anything."""
    return os.path.isabs(path) and os.path.isdir(path)


def _open(parent: Path, path: Path) -> None:
    """Make the folder `path` of compiled code; OSError if it cannot be used."""
    path.mkdir(parents=True, exist_ok=True)
    _check_writable(path)
    if parent.parent == Path(tempfile.gettempdir()):
        _check_mine(parent)
    _touch(path / _USED)


def _digest() -> str:
    digest = hashlib.sha256(sys.version.encode())
    for name in _DEPENDENCIES:
        digest.update(f'{name} {metadata.version(name)}\n'.encode())
    for source in sources(ROOT):
        digest.update(source)
    return digest.hexdigest()[:16]


def _check_writable(path: Path) -> None:
    with tempfile.TemporaryFile(dir=path):
        pass


def _check_mine(path: Path) -> None:
    """Raise OSError if another user could have written code into a folder in a shared place."""
    status = path.lstat()
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid():
        raise PermissionError(1, 'it belongs to another user')
    path.chmod(0o700)


def _touch(path: Path) -> None:
    """Renew the time stamp of a folder in use, at most once a day."""
    try:
        if time.time() - path.stat().st_mtime < _DAY:
            return
    except FileNotFoundError:
        pass
    path.touch()


def _unused(parent: Path) -> Iterator[Path]:
    """Yield the folders of compiled code that no process has used for 30 days."""
    for path in parent.iterdir():
        if _NAME.fullmatch(path.name) and path.is_dir() and not path.is_symlink():
            stamp = path / _USED
            try:
                last = (stamp if stamp.exists() else path).stat().st_mtime
            except OSError:
                continue
            if time.time() - last > _KEPT:
                yield path
