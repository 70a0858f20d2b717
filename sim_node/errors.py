"""The exception for invalid input from users, and checks of names that raise it."""

import difflib
import reprlib
from collections.abc import Iterable
from typing import Any


class _Short(reprlib.Repr):
    """Represents values in short: a few lines of YAML with aliases can expand to any length."""

    def repr1(self, x: Any, level: int) -> str:
        """Represent a value; numbers and arrays of numpy as Python's numbers and lists."""
        return super().repr1(of_python(x), level)


_SHORT = _Short()
_SHORT.maxlevel, _SHORT.maxlist, _SHORT.maxtuple, _SHORT.maxdict = 4, 20, 20, 20
_SHORT.maxstring = _SHORT.maxother = _SHORT.maxlong = 80


class InvalidInput(ValueError):
    """Invalid input from outside: a name, a file, a parameter.

    The message is one line with the source, the field, the value and the expectation. A command
    prints it unchanged and exits.
    """

    def __init__(self, field: str, value: object, expected: str, source: str = '') -> None:
        value = of_python(value)
        is_nested = isinstance(value, (list, tuple, dict))
        shown = _SHORT.repr(value) if is_nested else repr(value)
        if len(shown) > 80:
            shown = shown[:77] + '...'
        where = f'{source}: {field}' if source else field
        super().__init__(f'{where}: got {shown}, expected {expected}')
        self.field, self.value, self.expected, self.source = field, value, expected, source

    def __reduce__(self) -> tuple:
        return type(self), (self.field, self.value, self.expected, self.source)

    def found_in(self, source: str) -> 'InvalidInput':
        """Return the same error with `source` (a file, a node) in front of its own source."""
        inner = f'{source}: {self.source}' if self.source else source
        return InvalidInput(self.field, self.value, self.expected, inner)


def of_python(value: Any) -> Any:
    """Return a number or array of numpy as Python's number or list; other values as they are.

    `repr` shows numbers of numpy as np.float64(900.0), and JSON does not know them.
    """
    is_of_numpy = hasattr(value, 'tolist') and not isinstance(value, type)
    return value.tolist() if is_of_numpy else value


def near_miss(name: str, known: Iterable[str]) -> str:
    """Return " (did you mean '...'?)" if `name` is close to one of `known`, else ''."""
    folded = {k.lower(): k for k in known}
    close = difflib.get_close_matches(name.lower(), folded, n=1)
    return f" (did you mean '{folded[close[0]]}'?)" if close else ''


def check_name(field: str, name: object, known: Iterable[str], source: str = '') -> None:
    """Raise InvalidInput, with the closest known name, if `name` is not one of `known`."""
    known = tuple(known)
    if name not in known:
        expected = f'one of {", ".join(known)}' + near_miss(str(name), known)
        raise InvalidInput(field, name, expected, source)


def check_keys(field: str, values: dict, known: Iterable[str]) -> None:
    """Raise InvalidInput, with the closest known key, if a key of `values` is not in `known`."""
    known = tuple(known)
    for key in values:
        check_name(field, key, known)
