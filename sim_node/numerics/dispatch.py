"""Functions of compiled code that act by the class of a named tuple: by a method of that class.

So a thing of a registry (a sensor, a neuron model) is a named tuple of its constants with a
compiled method, and compiled code that is given one calls its method without a branch.
"""

from collections.abc import Callable
from typing import Any

from numba.extending import overload

INLINED = {'forceinline': True, 'error_model': 'numpy'}
"""Options of an overload that goes into each of its callers, as `jit.compiled_inline` does."""


def method(name: str, doc: str) -> Callable:
    """Return a function f(constants, *arguments) that calls the static method of that name.

    The method belongs to the class of `constants`, a named tuple; it is a `compiled_inline`
    function with the same arguments, `constants` first. Python can call it, too.
    """

    def call(constants: Any, *arguments: Any) -> Any:
        return getattr(constants, name)(constants, *arguments)

    call.__doc__ = doc

    @overload(call, jit_options=INLINED)
    def compiled_call(constants, *arguments):
        function = getattr(constants.instance_class, name)
        return lambda constants, *arguments: function(constants, *arguments)  # noqa: PLW0108

    return call

