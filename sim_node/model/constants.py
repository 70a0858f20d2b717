"""Constants that are declared once: default, range or choices, unit and meaning.

The declaration is a dataclass field. It serves the check in the constructor, the descriptors of
ROS parameters, the help of commands and the documentation.
"""

import contextlib
from collections.abc import Callable, Collection
from dataclasses import Field, field, fields
from typing import Any

from sim_node.errors import InvalidInput, check_name


def constant(default: Any, low: float, high: float, text: str, unit: str = '') -> Any:
    """Declare a number, whole if `default` is: default, range (inclusive), meaning and unit."""
    return field(default=default, metadata={'low': low, 'high': high, 'text': text, 'unit': unit})


def choice(default: Any, choices: Collection, text: str) -> Any:
    """Declare a constant that is one of a few values, texts or truth values, or of a registry."""
    return field(default=default, metadata={'choices': choices, 'text': text, 'unit': ''})


def flag(default: bool, text: str) -> Any:
    """Declare a truth value."""
    return choice(default, (False, True), text)


def check_text(name: str, value: object) -> None:
    """Raise InvalidInput if `value` is no text."""
    if not isinstance(value, str):
        raise InvalidInput(name, value, 'a text')


def text_value(
    default: str, text: str, form: str, read: Callable[[str, Any], object] = check_text
) -> Any:
    """Declare a text.

    Args:
        default: if none is given.
        text: its meaning.
        form: how it is written, for people.
        read: called with the field's name and the value, raises InvalidInput if it cannot be read.
    """
    return field(default=default, metadata={'form': form, 'read': read, 'text': text, 'unit': ''})


def same_as(kind: type, name: str) -> Any:
    """Declare what another dataclass declares under the same name."""
    f = declaration(kind, name)
    return field(default=f.default, metadata=f.metadata)


def declared(kind: type | Any) -> tuple[Field, ...]:
    """Return the fields of a dataclass, or of an instance, that are declared here."""
    return tuple(f for f in fields(kind) if 'text' in f.metadata)


def declaration(kind: type, name: str) -> Field:
    """Return the declared field of that name."""
    (found,) = (f for f in declared(kind) if f.name == name)
    return found


def check_declared(instance: Any, where: str = '') -> None:
    """Check all declared fields of a dataclass.

    Args:
        instance: of the dataclass.
        where: before the name of a field in errors, such as 'material.'.

    Raises:
        InvalidInput: a value is of another kind, not finite, or out of its range or choices.
    """
    for f in declared(instance):
        check_value(f'{where}{f.name}', getattr(instance, f.name), f)


class Checked:
    """Base of dataclasses whose constructor checks the declared fields, and no more."""

    def __post_init__(self) -> None:
        check_declared(self)


def value_of(name: str, text: str, f: Field) -> Any:
    """Return the value of a field that a person wrote as text.

    Raises:
        InvalidInput: naming `name`; it is not what the field declares.
    """
    value: Any = text
    if 'low' in f.metadata:
        number: type = type(f.default)
        with contextlib.suppress(ValueError):  # the check says what is expected
            value = number(text)
    check_value(name, value, f)
    return value


def check_value(name: str, value: Any, f: Field) -> None:
    """Raise InvalidInput, naming `name`, if a value is not what its field declares."""
    if 'read' in f.metadata:
        f.metadata['read'](name, value)
    elif 'choices' not in f.metadata:
        check_number(name, value, f)
    elif all(isinstance(known, str) for known in f.metadata['choices']):
        check_name(name, value, f.metadata['choices'])
    elif not isinstance(value, (bool, str)) or value not in f.metadata['choices']:
        raise InvalidInput(name, value, f'one of {_choices(f)}')


def check_number(name: str, value: Any, f: Field) -> None:
    """Raise InvalidInput, naming `name`, if `value` is not such a number as its field declares."""
    whole = isinstance(f.default, int)
    kinds = (int,) if whole else (int, float)
    is_kind = isinstance(value, kinds) and not isinstance(value, bool)
    if not is_kind or not f.metadata['low'] <= value <= f.metadata['high']:
        kind, unit = 'an integer' if whole else 'a number', f.metadata['unit']
        raise InvalidInput(
            name, value, f'{kind} from {values_of(f)}' + (f' [{unit}]' if unit else '')
        )


def values_of(f: Field) -> str:
    """Return what values a field may have: '0 to 10', 'stop, go_on', or how a text is written."""
    if 'form' in f.metadata:
        return f.metadata['form']
    if 'choices' in f.metadata:
        return _choices(f)
    low, high = f.metadata['low'], f.metadata['high']
    return f'{low} to {high}' if isinstance(f.default, int) else f'{low:g} to {high:g}'


def shown(value: Any) -> str:
    """Return a value as help and documents write it."""
    if isinstance(value, bool):
        return str(value).lower()
    return f'{value:.15g}' if isinstance(value, float) else str(value)


def _choices(f: Field) -> str:
    return ', '.join(shown(known) for known in f.metadata['choices'])


def describe(f: Field) -> str:
    """Return the meaning of a declared field with its unit, its choices or its form."""
    unit = f' [{f.metadata["unit"]}]' if f.metadata['unit'] else ''
    is_list = 'form' in f.metadata or ('choices' in f.metadata and not isinstance(f.default, bool))
    return f'{f.metadata["text"]}{unit}' + (f': {values_of(f)}' if is_list else '')


def help_of(kind: type, name: str) -> str:
    """Return the meaning of a declared field with unit or choices, and its default."""
    f = declaration(kind, name)
    return describe(f) + (f' (default {shown(f.default)})' if f.default != '' else '')
