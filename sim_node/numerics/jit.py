"""Compiled functions: numba's, with a cache that lasts (`code_cache`)."""

import fcntl
import inspect
import os
from collections.abc import Callable
from typing import Any

import numba
from numba.core.ccallback import CFunc
from numba.core.compiler import Compiler
from numba.core.sigutils import normalize_signature

from sim_node.numerics.code_cache import CodeCache, folder


def _kept(compiled: Any, function: Callable) -> Any:
    """Let a compiled function keep its code between processes, where there is a place for it.

    One of a notebook is in no file, and its code is not kept.
    """
    if folder() is not None and os.path.isfile(inspect.getfile(function)):
        compiled._cache = CodeCache(function)
    return compiled


def _compiled(function: Callable, **options: Any) -> Callable:
    dispatcher = numba.njit(function, error_model='numpy', no_cfunc_wrapper=True, **options)
    return _kept(dispatcher, function)


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
    """Numba's compiler, which assumes that the array arguments of a function share no memory."""

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
    def decorate(function: Callable) -> Callable:
        options = {'error_model': 'numpy'}
        callback = _kept(
            CFunc(function, normalize_signature(signature), {}, options), function
        )
        callback.compile()
        return callback

    return decorate


def warm_up(name: str, run: Callable[[], object]) -> None:
    """Call `run`, which uses compiled functions; of many processes only one compiles them.

    Args:
        name: what is compiled, the same in all processes.
        run: calls the functions once; quick when they are in the cache.
    """
    place = folder()
    if place is None or (done := place / f'{name}.compiled').exists():
        run()
        return
    with (place / f'{name}.lock').open('w') as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        run()
        done.touch()
