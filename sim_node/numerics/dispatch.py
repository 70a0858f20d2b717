"""Static dispatch in compiled code: functions selected by the class of a named tuple.

An entry of a registry (a sensor, a neuron model) is a named tuple of its constants with compiled
static methods. Compiled code that receives one calls its method without a branch at run time.
"""

from collections.abc import Callable
from typing import Any

from numba.extending import overload

INLINED = {'forceinline': True, 'error_model': 'numpy'}
"""Options of an `overload` that is inlined into its callers, with IEEE arithmetic."""


def method(name: str, doc: str, default: Callable | None = None) -> Callable:
    """Return a function f(constants, *arguments) that calls the static method of that name.

    The method belongs to the class of `constants`, a named tuple; it is a `compiled_inline`
    function with the same arguments, `constants` first. The returned function works in Python, too.

    Args:
        name: name of the method.
        doc: docstring of the returned function.
        default: method of classes without one; by default every class must have the method.
    """

    def call(constants: Any, *arguments: Any) -> Any:
        function: Any = getattr(type(constants), name, default)
        return function(constants, *arguments)

    call.__doc__ = doc

    @overload(call, jit_options=INLINED)
    def compiled_call(constants, *arguments):
        function: Any = getattr(constants.instance_class, name, default)
        return lambda constants, *arguments: function(constants, *arguments)  # noqa: PLW0108

    return call


def by_attribute(
    name: str, choices: dict[Any, Callable], doc: str, *, default: Any = None
) -> Callable:
    """Return a function f(constants, *arguments) that calls one of several compiled functions.

    Args:
        name: name of an attribute of the class of `constants`, a named tuple.
        choices: the function for each value of the attribute, with the same arguments.
        doc: docstring of the returned function.
        default: the value for classes without the attribute.
    """

    def call(constants: Any, *arguments: Any) -> Any:
        return choices[getattr(type(constants), name, default)](constants, *arguments)

    call.__doc__ = doc

    @overload(call, jit_options=INLINED)
    def compiled_call(constants, *arguments):
        function = choices[getattr(constants.instance_class, name, default)]
        return lambda constants, *arguments: function(constants, *arguments)  # noqa: PLW0108

    return call
