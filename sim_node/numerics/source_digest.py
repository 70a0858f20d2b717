"""Digests of sources: of all that compiled code of this project, or of a plug-in, depends on."""

import functools
import hashlib
import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
"""The folder of the two packages."""

PACKAGES = 'sim_node', 'snca_ros'


def sources(root: Path) -> list[bytes]:
    """Return the sources of the modules with compiled functions, and of all that they import.

    Args:
        root: the folder of the packages.
    """
    texts = {
        '.'.join(path.relative_to(root).with_suffix('').parts): path.read_bytes()
        for package in PACKAGES
        for path in (root / package).rglob('*.py')
    }
    imports = {name: _imports(text) for name, text in texts.items()}
    needed, waiting = set[str](), [name for name in texts if _compiles(imports[name])]
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed.add(name)
            waiting += [other for other in imports[name] if other in texts]
    return [texts[name] for name in sorted(needed)]


_JIT = f'{__name__.rpartition(".")[0]}.jit'


def _compiles(imports: set[str]) -> bool:
    """Return whether a module with these `_imports` has compiled functions."""
    callers = {f'{_JIT}.{name}' for name in ('warm_up', 'entry_point')}
    return any(name.startswith(f'{_JIT}.') and name not in callers for name in imports)


_IMPORT = re.compile(rb'^ *from ([\w.]+) import (\([^)]*\)|.*)', re.MULTILINE)


def _imports(source: bytes) -> set[str]:
    """Return the modules that a source imports from, and the imported names as module.name."""
    found = set[str]()
    for module, names in _IMPORT.findall(source):
        found.add(module.decode())
        found |= {b'.'.join((module, name)).decode() for name in re.findall(rb'\w+', names)}
    return found


def is_outside(source: Path) -> bool:
    """Return whether a file lies outside the two packages."""
    return not any(source.is_relative_to(ROOT / package) for package in PACKAGES)


@functools.cache
def digest_of(source: Path) -> str:
    """Return a digest of a file outside the packages and of the files that it imports from.

    Modules of the packages and of installed libraries are left out; the process must have loaded
    the others.
    """
    texts: dict[Path, bytes] = {}
    waiting = [source]
    while waiting:
        path = waiting.pop()
        if path not in texts:
            texts[path] = path.read_bytes()
            waiting += _own_modules(texts[path])
    digest = hashlib.sha256()
    for path in sorted(texts):
        digest.update(hashlib.sha256(texts[path]).digest())
    return digest.hexdigest()


def _own_modules(text: bytes) -> list[Path]:
    """Return the files that a source imports from, without those of the packages and libraries."""
    names = _imports(text) | {name.decode() for name in _PLAIN_IMPORT.findall(text)}
    files = [getattr(sys.modules.get(name), '__file__', None) for name in names]
    paths = [Path(file).resolve() for file in files if file and file.endswith('.py')]
    libraries = [Path(prefix).resolve() for prefix in (sys.prefix, sys.base_prefix)]
    return [
        path for path in paths
        if is_outside(path) and not any(path.is_relative_to(folder) for folder in libraries)
    ]


_PLAIN_IMPORT = re.compile(rb'^ *import ([\w.]+)', re.MULTILINE)
