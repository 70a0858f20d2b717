"""Functions of compiled code that act by the class of a named tuple.

A thing of a registry (a sensor, a neuron model) is a named tuple of its constants with compiled
static methods: compiled code that is given one calls its method without a branch at run time.
"""

from collections.abc import Callable
from typing import Any

from numba.extending import overload

INLINE = {'forceinline': True, 'error_model': 'numpy'}
"""Options of an `overload` that becomes part of its callers, with IEEE arithmetic."""


def method(name: str, doc: str, default: Callable | None = None) -> Callable:
    """Return a function f(constants, *arguments) that calls the static method of that name.

    The method belongs to the class of `constants`, a named tuple; it is a `compiled_inline`
    function with the same arguments, `constants` first. Python can call it, too.

    Args:
        name: of the method.
        doc: docstring of the function.
        default: what classes without such a method have; by default they must have one.
    """

    def call(constants: Any, *arguments: Any) -> Any:
        function: Any = getattr(type(constants), name, default)
        return function(constants, *arguments)

    call.__doc__ = doc

    @overload(call, jit_options=INLINE)
    def compiled_call(constants, *arguments):
        function: Any = getattr(constants.instance_class, name, default)
        return lambda constants, *arguments: function(constants, *arguments)  # noqa: PLW0108

    return call


def by_attribute(
    name: str, choices: dict[Any, Callable], doc: str, *, default: Any = None
) -> Callable:
    """Return a function f(constants, *arguments) that calls one of several compiled functions.

    Args:
        name: of an attribute of the class of `constants`, a named tuple.
        choices: a function per value of the attribute, with the same arguments.
        doc: docstring of the function.
        default: the value in classes that do not have the attribute.
    """

    def call(constants: Any, *arguments: Any) -> Any:
        return choices[getattr(type(constants), name, default)](constants, *arguments)

    call.__doc__ = doc

    @overload(call, jit_options=INLINE)
    def compiled_call(constants, *arguments):
        function = choices[getattr(constants.instance_class, name, default)]
        return lambda constants, *arguments: function(constants, *arguments)  # noqa: PLW0108

    return call
