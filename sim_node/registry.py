"""Engines, sensors, neuron models, tasks and strategies, each kind in a registry by name.

To add one from outside this project, write it in a module of your own that calls `register`, and
name that module in the environment variable SNCA_PLUGINS (several are separated by commas): every
command, node and worker process imports it when it first looks something up. No file that is read,
such as a controller file, causes an import.
"""

import importlib
import os
from collections.abc import Iterator, MutableMapping
from pkgutil import resolve_name
from typing import Generic, TypeVar, cast

from sim_node.errors import InvalidInput, check_name

PLUGINS = 'SNCA_PLUGINS'
"""The environment variable that names modules to import."""

T = TypeVar('T')


class Registry(MutableMapping[str, T], Generic[T]):
    """Things of one kind by name, in the order in which they were registered.

    Args:
        kind: what they are, as errors name it, such as 'neuron_model'.
        entries: the things of this project; a text 'module:name' is imported when it is needed.
    """

    def __init__(self, kind: str, entries: dict[str, T | str]) -> None:
        self.kind, self._entries = kind, dict(entries)

    def register(self, name: str, thing: T) -> None:
        """Add a thing; once more is no error.

        Raises:
            InvalidInput: the name is taken by another thing, or is not one that a file can hold.
        """
        if not isinstance(name, str) or not name or not name.isprintable() or ' ' in name:
            raise InvalidInput(self.kind, name, 'a name without spaces')
        if self._entries.get(name, thing) is not thing:
            taken = ', '.join(self._entries)
            raise InvalidInput(self.kind, name, f'a name that is not taken, unlike {taken}')
        self._entries[name] = thing

    def find(self, name: object, source: str = '') -> T:
        """Return the thing of that name.

        Raises:
            InvalidInput: there is none; the text lists the known names. `source` is named in it.
        """
        check_name(self.kind, name, self, source)
        return self[cast(str, name)]

    def __getitem__(self, name: str) -> T:
        _import_plugins()
        thing = self._entries[name]
        if isinstance(thing, str):
            thing = self._entries[name] = cast(T, resolve_name(thing))
        return thing

    def __setitem__(self, name: str, thing: T) -> None:
        self.register(name, thing)

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


_imported: list[str] = []


def _import_plugins() -> None:
    """Import the modules that SNCA_PLUGINS names, once per process.

    Raises:
        InvalidInput: one of them cannot be imported.
    """
    for module in os.environ.get(PLUGINS, '').replace(',', ' ').split():
        if module in _imported:
            continue
        _imported.append(module)  # first, for a plug-in looks things up itself
        try:
            importlib.import_module(module)
        except Exception as error:
            _imported.remove(module)
            expected = f'modules that can be imported ({type(error).__name__}: {error})'
            raise InvalidInput(PLUGINS, module, expected) from error
