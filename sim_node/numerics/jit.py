"""Compiled functions: numba with a cache that lasts, keyed by the sources it was made from."""

import fcntl
import functools
import hashlib
import os
import re
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numba
from numba.core import config
from numba.core.compiler import Compiler

_lock = threading.Lock()


@functools.cache
def _cache_folder() -> str:
    """Return the cache folder for the sources as they are now.

    Numba recompiles a function when its own file changes, but neither when a function that it
    calls does nor when a constant that it took from another module does. A digest of all sources
    that can matter, in the folder's name, makes a stale result impossible.
    """
    digest = hashlib.sha256(numba.__version__.encode())
    for source in _sources(Path(__file__).resolve().parents[2]):
        digest.update(source)
    home = os.environ.get('XDG_CACHE_HOME') or os.path.join(os.path.expanduser('~'), '.cache')
    return os.path.join(home, 'snca_ros', digest.hexdigest()[:16])


def _sources(root: Path) -> list[bytes]:
    """Return the modules below `root` that compile something, and all that they import."""
    packages = root / 'sim_node', root / 'snca_ros'
    sources = {
        '.'.join(path.relative_to(root).with_suffix('').parts): path.read_bytes()
        for package in packages
        for path in package.rglob('*.py')
    }
    imports = {name: _imports(source) for name, source in sources.items()}
    needed, waiting = set[str](), [name for name in sources if _compiles(imports[name])]
    while waiting:
        name = waiting.pop()
        if name not in needed:
            needed.add(name)
            waiting += [other for other in imports[name] if other in sources]
    return [sources[name] for name in sorted(needed)]


def _compiles(imports: set[str]) -> bool:
    """Tell whether a module with these `_imports` has compiled functions."""
    return any(
        name.startswith(f'{__name__}.') and not name.endswith('.warm_up') for name in imports
    )


_IMPORT = re.compile(rb'^ *from ([\w.]+) import (\([^)]*\)|.*)', re.MULTILINE)


def _imports(source: bytes) -> set[str]:
    """Return the modules, and the names as module.name, that a source imports from."""
    found = set[str]()
    for module, names in _IMPORT.findall(source):
        found.add(module.decode())
        found |= {b'.'.join((module, name)).decode() for name in re.findall(rb'\w+', names)}
    return found


def _cached(decorate: Callable) -> Callable:
    with _lock:
        before = vars(config)['CACHE_DIR']
        vars(config)['CACHE_DIR'] = before or _cache_folder()
        try:
            return decorate()
        finally:
            vars(config)['CACHE_DIR'] = before


def _compiled(function: Callable, **options: Any) -> Callable:
    return _cached(
        lambda: numba.njit(
            function, cache=True, error_model='numpy', no_cfunc_wrapper=True, **options
        )
    )


def compiled(function: Callable) -> Callable:
    """Compile `function` to machine code at its first call, or load it from the cache.

    IEEE arithmetic as written (no fast-math, no fused multiply-add), so that the same function
    gives the same bits wherever it is called from.
    """
    return _compiled(function)


_PART = {'no_cpython_wrapper': True, '_nrt': False}


def compiled_part(function: Callable) -> Callable:
    """Compile `function`, which makes no arrays, for compiled code alone; Python cannot call it.

    Half the work of compiling a function of many arrays is to turn Python's values into them, and
    half the time of a short one would go into counting references to them.
    """
    return _compiled(function, **_PART)


def compiled_inline(function: Callable) -> Callable:
    """Compile `function` into each of its callers: for small functions."""
    return _compiled(function, forceinline=True)


def inlined_part(function: Callable) -> Callable:
    """Compile such a part into each of its callers."""
    return _compiled(function, forceinline=True, **_PART)


class _NoAlias(Compiler):
    """Numba's compiler, told that the array arguments of a function share no memory."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.state.flags.noalias = True


def compiled_kernel(function: Callable) -> Callable:
    """Compile a function whose array arguments must not overlap, so that its loops vectorise.

    It too goes into each of its callers; vector instructions do the same arithmetic.
    """
    return _compiled(function, forceinline=True, pipeline_class=_NoAlias)


def compiled_callback(signature: Any) -> Callable:
    """Compile a function that C code can call; its `address` is the function pointer."""
    return lambda function: _cached(
        lambda: numba.cfunc(signature, cache=True, error_model='numpy')(function)
    )


def warm_up(name: str, run: Callable[[], object]) -> None:
    """Call `run`, which uses compiled functions; of many processes only one compiles them.

    Args:
        name: what is compiled, the same in all processes.
        run: calls the functions once; quick when they are in the cache.
    """
    folder = Path(_cache_folder())
    done = folder / f'{name}.compiled'
    if done.exists():
        run()
        return
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / f'{name}.lock').open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        run()
        done.touch()
