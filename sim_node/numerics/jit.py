"""Decorators that compile functions with numba and keep the code in the cache of `code_cache`."""

import contextlib
import fcntl
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.core.ccallback import CFunc
from numba.core.compiler import Compiler
from numba.core.sigutils import normalize_signature

from sim_node.errors import InvalidInput
from sim_node.numerics.cache_folder import folder
from sim_node.numerics.code_cache import CodeCache

if numba.config.DISABLE_JIT:
    raise InvalidInput('NUMBA_DISABLE_JIT', 1, '0: the physics and the cells are compiled code')

T = TypeVar('T')


def _kept(compiled: Any, function: Callable) -> Any:
    """Return `compiled` with a cache of its code, if there is a folder for the cache.

    A function typed into a notebook is not cached: it has no source file to identify its code.
    """
    if folder() is not None and os.path.isfile(function.__code__.co_filename):
        compiled._cache = CodeCache(function)
    return compiled


def _compiled(function: Callable, **options: Any) -> Callable:
    dispatcher = numba.njit(function, error_model='numpy', no_cfunc_wrapper=True, **options)
    return _kept(dispatcher, function)


def compiled(function: Callable) -> Callable:
    """Compile `function` to machine code at its first call, or load it from the cache.

    Arithmetic is IEEE as written, without fast-math and fused multiply-add, so that a function
    gives the same bits in all of its callers.
    """
    return _compiled(function)


def entry_point(function: Callable, *arguments: Any) -> Callable:
    """Return a `compiled` function for arguments of these types, compiled or loaded now.

    It is called without looking at the types of its arguments, which takes longer than a short
    function itself. The caller must pass the same types.
    """
    dispatcher: Any = function
    return dispatcher.compile(tuple(numba.typeof(argument) for argument in arguments))


_PART = {'no_cpython_wrapper': True, '_nrt': False}


def compiled_part(function: Callable) -> Callable:
    """Compile `function`, which creates no arrays, for compiled callers; Python cannot call it.

    Without the conversion of Python values, a function of many arrays compiles in half the time;
    without counting references to arrays, a short one runs in half the time.
    """
    return _compiled(function, **_PART)


def compiled_inline(function: Callable) -> Callable:
    """Compile a small `function` to be inlined into each of its callers."""
    return _compiled(function, forceinline=True)


def inlined_part(function: Callable) -> Callable:
    """Compile `function` as `compiled_part` does, to be inlined into each of its callers."""
    return _compiled(function, forceinline=True, **_PART)


class _NoAlias(Compiler):
    """Numba's compiler, which assumes that the array arguments of a function share no memory."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.state.flags.noalias = True


def compiled_kernel(function: Callable) -> Callable:
    """Compile a function whose array arguments must not overlap, so that its loops vectorise.

    It is inlined into each of its callers. Vector instructions give the same bits.
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


def warm_up(name: str, run: Callable[[], T]) -> T:
    """Return the result of `run`; of many processes, only one compiles the functions it uses.

    Args:
        name: name of the set of functions, the same in all processes.
        run: calls or compiles the functions.
    """
    place = folder()
    if place is None or (done := place / f'{name}.compiled').exists():
        return run()
    with _locked(place / f'{name}.lock'):
        result = run()
        with contextlib.suppress(OSError):
            done.touch()
    return result


def _locked(path: Path) -> contextlib.AbstractContextManager:
    """Return the open file, locked; a context without a lock if the file cannot be locked."""
    with contextlib.ExitStack() as stack:
        with contextlib.suppress(OSError):  # then several processes may compile the same
            fcntl.flock(stack.enter_context(path.open('a')), fcntl.LOCK_EX)
        return stack.pop_all()
