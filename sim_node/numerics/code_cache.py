"""The cache of compiled code between processes: its folder, its keys, and checks for damage.

Numba recompiles a function when its own file changes, but not when a function that it calls, a
constant from another module, or a library changes. So the folder is named by a digest of all of
these; numba itself adds the processor to the key of every function.
"""

import functools
import hashlib
import inspect
import os
import pickle
import re
import shutil
import stat
import sys
import tempfile
import time
from collections.abc import Iterable, Iterator
from importlib import metadata
from pathlib import Path
from typing import Any

from numba.core import types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile

from sim_node.numerics.source_digest import ROOT, digest_of, is_outside, sources

_DEPENDENCIES = 'numba', 'llvmlite', 'numpy', 'pymunk'
_NAME = re.compile(r'[0-9a-f]{16}')
_USED, _DAY, _KEPT = 'used', 86_400.0, 30 * 86_400.0  # name of the stamp file; seconds
_SUM = hashlib.sha256().digest_size


@functools.cache
def folder() -> Path | None:
    """Return the folder of compiled code for the sources and libraries as they are now.

    It is below NUMBA_CACHE_DIR or XDG_CACHE_HOME, if one is set, else below ~/.cache. Folders of
    other versions that no process has used for 30 days are removed.

    Returns:
        The folder, which exists and is writable. None if there is no such folder: every process
        then compiles, and a message on standard error reports it once.
    """
    parent = _parent()
    path = parent / _digest()
    try:
        path.mkdir(parents=True, exist_ok=True)
        _check_writable(path)
        if parent.parent == Path(tempfile.gettempdir()):
            _check_mine(parent)
        _touch(path / _USED)
    except OSError as error:
        print(
            f'{path}: {error.strerror}: compiled code cannot be kept: this process has to '
            'compile for about a minute; set XDG_CACHE_HOME to a writable folder',
            file=sys.stderr,
        )
        return None
    for old in _unused(parent):
        shutil.rmtree(old, ignore_errors=True)
    return path


def _parent() -> Path:
    """Return the folder that holds the folders of compiled code of all versions."""
    for variable in ('NUMBA_CACHE_DIR', 'XDG_CACHE_HOME'):
        if os.environ.get(variable):
            return Path(os.environ[variable], 'snca_ros').absolute()
    home = os.path.expanduser('~')
    if os.path.isabs(home):
        return Path(home, '.cache', 'snca_ros')
    return Path(tempfile.gettempdir(), f'snca_ros-{os.getuid()}')  # no home at all


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
    path.chmod(0o700)
    if not stat.S_ISDIR(status.st_mode) or status.st_uid != os.getuid():
        raise PermissionError(1, 'it belongs to another user')


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


class _Place:
    """The cache folder and source stamp of one function (numba's cache locator)."""

    def __init__(self, function: Any) -> None:
        source, module = Path(inspect.getfile(function)).resolve(), function.__module__
        self._line = function.__code__.co_firstlineno
        self._stamp = ''
        if is_outside(source):
            self._stamp = digest_of(source)
            module += '-' + hashlib.sha256(str(source).encode()).hexdigest()[:16]
        self._path = os.path.join(str(folder()), module)

    def ensure_cache_path(self) -> None:
        os.makedirs(self._path, exist_ok=True)

    def get_cache_path(self) -> str:
        return self._path

    def get_source_stamp(self) -> str:
        return self._stamp

    def get_disambiguator(self) -> str:
        return str(self._line)


class _Results(CompileResultCacheImpl):
    """Serialises compiled code as numba does, for files in the folder of `_Place`."""

    def __init__(self, function: Any) -> None:
        self._locator = _Place(function)
        self._filename_base = self.get_filename_base(function.__qualname__, sys.abiflags)


class _CheckedFiles(IndexDataCacheFile):
    """Cache files with a checksum: linking damaged machine code could crash the process."""

    def _load_data(self, name: str) -> Any:
        with open(self._data_path(name), 'rb') as file:
            checksum, data = file.read(_SUM), file.read()
        if hashlib.sha256(data).digest() != checksum:
            raise ValueError(f'{name} is damaged')
        return pickle.loads(data)

    def _save_data(self, name: str, data: Any) -> None:
        dumped = self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            file.write(hashlib.sha256(dumped).digest() + dumped)


def _classes(kinds: Iterable[Any]) -> Iterator[type]:
    """Yield the classes of all named tuples among numba types."""
    for kind in kinds:
        if isinstance(kind, types.BaseTuple):
            if isinstance(kind, types.BaseNamedTuple):
                yield kind.instance_class
            yield from _classes(kind)


def _stamps(signature: Any) -> tuple[str, ...] | None:
    """Return names and module digests of the classes in a signature from outside the packages.

    Compiled code calls methods of such a class (`dispatch`), so it depends on its module.

    Args:
        signature: a tuple of types, or an object that has one as `args`.

    Returns:
        One string per class; None if a class is defined in the main program or in no file, since
        it is then another class in each process.
    """
    found = []
    for kind in _classes(getattr(signature, 'args', signature)):
        try:
            source = Path(inspect.getfile(kind)).resolve()
        except (TypeError, OSError):
            return None
        if kind.__module__ == '__main__':
            return None
        if is_outside(source):
            found.append(f'{kind.__module__}.{kind.__qualname__} {digest_of(source)}')
    return tuple(found)


class CodeCache(FunctionCache):
    """The cache of one function's compiled versions; it discards those that it cannot load.

    Versions for classes outside the packages are in files of their own: a process that cannot
    import such a class could not read an index that names it.
    """

    _impl_class = _Results

    def __init__(self, function: Any) -> None:
        super().__init__(function)
        self._choose_file(())

    def _choose_file(self, signature: Any) -> bool:
        """Take the files for versions of such a signature; False if they are not to be kept."""
        stamps = _stamps(signature)
        if stamps is None:
            return False
        digest = hashlib.sha256('\n'.join(stamps).encode()).hexdigest()[:16]
        self._cache_file = _CheckedFiles(
            cache_path=self._cache_path,
            filename_base=self._impl.filename_base + (f'.{digest}' if stamps else ''),
            source_stamp=self._impl.locator.get_source_stamp(),
        )
        return True

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """Return the compiled version for a signature; None if it is missing or damaged."""
        if not self._choose_file(sig):
            return None
        try:
            return super().load_overload(sig, target_context)
        except Exception:
            self.flush()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write a compiled version to the cache; report on standard error if that fails."""
        if not self._choose_file(sig):
            return
        try:
            super().save_overload(sig, data)
        except OSError as error:
            print(f'{self._cache_path}: {error.strerror}: compiled code is not kept',
                  file=sys.stderr)
