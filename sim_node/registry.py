"""Registries of engines, sensors, neuron models, tasks and strategies by name, and plug-ins.

To add an entry from outside this project, write a module that calls `register`, and name it in the
environment variable SNCA_PLUGINS (separate several by commas). Every command, node and worker
process imports the module at its first lookup in a registry. Files that are read, such as
controller files, never cause an import.
"""

import importlib
import os
from collections.abc import Iterable, Iterator, MutableMapping
from pkgutil import resolve_name
from typing import Generic, TypeVar, cast

from sim_node.errors import InvalidInput, check_name

PLUGINS = 'SNCA_PLUGINS'
"""Environment variable with the names of plug-in modules."""

T = TypeVar('T')


class Registry(MutableMapping[str, T], Generic[T]):
    """The entries of one kind by name, in the order of registration.

    Args:
        kind: the kind of entry as errors name it, such as 'neuron_model'.
        entries: the entries of this project. A string 'module:name' is imported at its first use.
    """

    def __init__(self, kind: str, entries: dict[str, T | str]) -> None:
        self.kind, self._entries = kind, dict(entries)

    def register(self, name: str, entry: T) -> None:
        """Add an entry. Adding the same entry again has no effect.

        Raises:
            InvalidInput: the name is taken by another entry, or is empty, has a space or a slash
                or is not printable.
        """
        if not isinstance(name, str) or not name or not name.isprintable() or {*' /'} & {*name}:
            raise InvalidInput(self.kind, name, 'a name without spaces and slashes')
        if self._entries.get(name, entry) is not entry:
            taken = ', '.join(self._entries)
            raise InvalidInput(self.kind, name, f'a name that is not taken, unlike {taken}')
        self._entries[name] = entry

    def find(self, name: object, source: str = '') -> T:
        """Return the entry of that name.

        Args:
            name: the name.
            source: where it was given (a file, a node), for the error.

        Raises:
            InvalidInput: there is no such entry; the message lists the known names.
        """
        check_name(self.kind, name, self, source)
        return self[cast(str, name)]

    def __getitem__(self, name: str) -> T:
        _import_plugins()
        entry = self._entries[name]
        if isinstance(entry, str):
            entry = self._entries[name] = cast(T, resolve_name(entry))
        return entry

    def __setitem__(self, name: str, entry: T) -> None:
        self.register(name, entry)

    def __delitem__(self, name: str) -> None:
        del self._entries[name]

    def __iter__(self) -> Iterator[str]:
        _import_plugins()
        return iter(self._entries)

    def __len__(self) -> int:
        _import_plugins()
        return len(self._entries)

    def __contains__(self, name: object) -> bool:
        _import_plugins()
        return name in self._entries


_CLASSES: dict[str, type] = {}


def check_class_name(where: str, kind: type, known: Iterable[type]) -> None:
    """Check the name of a class whose methods compiled code calls.

    Compiled code is known by the name of the class that it was compiled for. Of two classes of
    one name, in whatever modules, the second would run the code of the first.

    Args:
        where: the entry of a registry, for the error.
        kind: its class.
        known: the classes of other entries.

    Raises:
        InvalidInput: this process has another class of the same name.
    """
    for one in (*known, kind):
        _CLASSES.setdefault(one.__name__, one)
    other = _CLASSES[kind.__name__]
    if other is not kind:
        expected = (
            f'another class name: {other.__module__} has defined a class of this name. '
            'Compiled code is known by it, so restart Python after a change of a class'
        )
        raise InvalidInput(where, kind.__name__, expected)


_imported: list[str] = []


def _import_plugins() -> None:
    """Import the modules named in SNCA_PLUGINS, once per process.

    Raises:
        InvalidInput: one of them cannot be imported.
    """
    for module in os.environ.get(PLUGINS, '').replace(',', ' ').split():
        if module in _imported:
            continue
        _imported.append(module)  # before the import, since a plug-in itself makes lookups
        try:
            importlib.import_module(module)
        except Exception as error:
            _imported.remove(module)
            expected = f'modules that can be imported ({type(error).__name__}: {error})'
            raise InvalidInput(PLUGINS, module, expected) from error
