"""The cache of compiled code between processes: its keys, its files, and checks for damage."""

import contextlib
import hashlib
import inspect
import os
import pickle
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

from numba.core import types
from numba.core.caching import CompileResultCacheImpl, FunctionCache, IndexDataCacheFile

from sim_node.numerics.cache_folder import folder
from sim_node.numerics.source_digest import digest_of, is_outside

_SUM = hashlib.sha256().digest_size


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
    """Cache files with a checksum: linking damaged machine code could crash the process.

    The checksum includes the name of the file, so that one cannot stand in for another.
    """

    def load(self, key: Any) -> Any:
        """Return the entry of a key; None if there is none."""
        name = self._load_index().get(key)
        try:
            return None if name is None else self._load_data(name)
        except FileNotFoundError:
            return None

    def _load_index(self) -> dict:
        try:
            stamp, entries = self._load_data(self._index_name)
        except FileNotFoundError:
            return {}
        return entries if stamp == self._source_stamp else {}

    def _save_index(self, overloads: dict) -> None:
        self._save_data(self._index_name, (self._source_stamp, overloads))

    def _load_data(self, name: str) -> Any:
        with open(self._data_path(name), 'rb') as file:
            checksum, data = file.read(_SUM), file.read()
        if self._checksum(name, data) != checksum:
            raise ValueError('damaged')
        return pickle.loads(data)

    def _save_data(self, name: str, data: Any) -> None:
        dumped = self._dump(data)
        with self._open_for_write(self._data_path(name)) as file:
            file.write(self._checksum(name, dumped) + dumped)

    def _checksum(self, name: str, data: bytes) -> bytes:
        place = os.path.join(os.path.basename(self._cache_path), name)
        return hashlib.sha256(os.fsencode(place) + b'\0' + data).digest()


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
        except Exception as error:
            with contextlib.suppress(OSError):  # then `save_overload` reports that it fails
                self.flush()
                _report(self._cache_path, error, 'compiled code is dropped and compiled again')
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Write a compiled version to the cache; report on standard error if that fails."""
        if not self._choose_file(sig):
            return
        try:
            super().save_overload(sig, data)
        except Exception as error:
            _report(self._cache_path, error, 'compiled code is not kept')


_reported: set[str] = set()


def _report(path: str, error: Exception, consequence: str) -> None:
    """Print one line on standard error, the first time that there is such a consequence."""
    if consequence not in _reported:
        _reported.add(consequence)
        reason = getattr(error, 'strerror', None) or ' '.join(str(error).split())
        print(f'{path}: {reason}: {consequence}', file=sys.stderr)
