"""Definitions of message types, which bags contain so that any tool can read them."""

import importlib
import os
import re
import sys
from collections.abc import Iterator
from pathlib import Path

from rosbags.typesys import Stores, get_typestore

_FIELD = re.compile(r'\s*([A-Za-z][A-Za-z0-9_/]*)(?:<=\d+)?(?:\[[^]]*\])?\s+[A-Za-z]')
_BUILT_IN = re.compile(r'bool|byte|char|w?string|float(32|64)|u?int(8|16|32|64)')
_SEPARATOR = f'{"=" * 80}\nMSG: '
_NO_HASH = f'RIHS01_{"0" * 64}'


def message_class(name: str) -> type:
    """Return the Python class of a message type such as 'sensor_msgs/msg/JointState'.

    Raises:
        Exception: of any kind if it is not installed, or its package is broken.
    """
    package, kind, message = name.split('/')
    return getattr(importlib.import_module(f'{package}.{kind}'), message)


class MessageDefinitions:
    """Definitions of types: of those that rosbags knows, and of those that are installed."""

    def __init__(self) -> None:
        self._store = get_typestore(Stores.ROS2_JAZZY)

    def of(self, name: str, type_hash: str) -> tuple[str, str]:
        """Return the definition of a type, empty if it is not known, and its RIHS01 hash.

        Args:
            name: of the type.
            type_hash: its hash as the graph shows it, for types that rosbags does not know.
        """
        store = self._store
        if name in store.fielddefs:
            return store.generate_msgdef(name, ros_version=2)[0], store.hash_rihs01(name)
        return installed_definition(name), type_hash if '_' in type_hash else _NO_HASH


def installed_definition(name: str) -> str:
    """Return the text of a type and of all types in it as rosbag2 stores them.

    It is read from the .msg files in the share folders; empty if one is not there.
    """
    parts: dict[str, str] = {}
    wanted = [name]
    while wanted:
        kind = wanted.pop(0)
        if kind in parts:
            continue
        file = _file_of(kind)
        if file is None:
            return ''
        parts[kind] = file.read_text(encoding='utf-8', errors='replace')
        wanted += _types_in(parts[kind], kind.partition('/')[0])
    first, *others = parts.items()
    short = (f'{_SEPARATOR}{kind.replace("/msg/", "/")}\n{text}' for kind, text in others)
    return ''.join(text if text.endswith('\n') else f'{text}\n' for text in (first[1], *short))


def _file_of(name: str) -> Path | None:
    package, kind, message = name.split('/')
    prefixes = [*os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep), sys.prefix]
    for prefix in filter(None, prefixes):
        file = Path(prefix, 'share', package, kind, f'{message}.msg')
        if file.is_file():
            return file
    return None


def _types_in(text: str, package: str) -> Iterator[str]:
    """Yield the full names of the types of a definition's fields."""
    for line in text.splitlines():
        field = _FIELD.match(line.partition('#')[0])
        if field and not _BUILT_IN.fullmatch(field[1]):
            *owner, message = field[1].split('/')
            yield f'{owner[0] if owner else package}/msg/{message}'
