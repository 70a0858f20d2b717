"""Declarations of options as dataclass fields: default, range or choices, unit and meaning.

One declaration is used by the check in the constructor, the descriptors of ROS parameters, the
help texts of commands and the documentation.
"""

import contextlib
from collections.abc import Callable, Collection
from dataclasses import Field, field, fields
from typing import Any

from sim_node.errors import InvalidInput, check_name


def constant(default: Any, low: float, high: float, text: str, unit: str = '') -> Any:
    """Declare a number, an integer if `default` is one, with its inclusive range and unit."""
    return field(default=default, metadata={'low': low, 'high': high, 'text': text, 'unit': unit})


def choice(default: Any, choices: Collection, text: str) -> Any:
    """Declare an option with a few choices: strings, booleans, or the names of a registry."""
    return field(default=default, metadata={'choices': choices, 'text': text, 'unit': ''})


def flag(default: bool, text: str) -> Any:
    """Declare a boolean."""
    return choice(default, (False, True), text)


def check_text(name: str, value: object) -> None:
    """Raise InvalidInput if `value` is not a string."""
    if not isinstance(value, str):
        raise InvalidInput(name, value, 'a string')


def text_value(
    default: str, text: str, form: str, read: Callable[[str, Any], object] = check_text
) -> Any:
    """Declare a string.

    Args:
        default: its default.
        text: its meaning.
        form: its format, as help texts describe it.
        read: called with the field's name and the value; raises InvalidInput if the value has
            another format.
    """
    return field(default=default, metadata={'form': form, 'read': read, 'text': text, 'unit': ''})


def same_as(kind: type, name: str) -> Any:
    """Return the declaration of the field `name` of another dataclass, for a field of that name."""
    f = declaration(kind, name)
    return field(default=f.default, metadata=f.metadata)


def declared(kind: type | Any) -> tuple[Field, ...]:
    """Return the fields of a dataclass, or of an instance of one, that have a declaration."""
    return tuple(f for f in fields(kind) if 'text' in f.metadata)


def declaration(kind: type, name: str) -> Field:
    """Return the declared field of that name of a dataclass."""
    (found,) = (f for f in declared(kind) if f.name == name)
    return found


def check_declared(instance: Any, where: str = '') -> None:
    """Check all declared fields of a dataclass.

    Args:
        instance: an instance of the dataclass.
        where: prefix of field names in errors, such as 'material.'.

    Raises:
        InvalidInput: a value has another type, is not finite, or is out of its range or choices.
    """
    for f in declared(instance):
        check_value(f'{where}{f.name}', getattr(instance, f.name), f)


class Checked:
    """Base class of dataclasses whose constructor only checks the declared fields."""

    def __post_init__(self) -> None:
        check_declared(self)


def value_of(name: str, text: str, f: Field) -> Any:
    """Return the value of a field from the text that a user typed.

    Args:
        name: name of the option in errors.
        text: the typed text.
        f: the declared field.

    Raises:
        InvalidInput: the text is not a valid value of the field.
    """
    value: Any = text
    if 'low' in f.metadata:
        number: type = type(f.default)
        with contextlib.suppress(ValueError):  # check_value raises with the expected range
            value = number(text)
    check_value(name, value, f)
    return value


def check_value(name: str, value: Any, f: Field) -> None:
    """Raise InvalidInput for `name` if a value is not valid for its declared field."""
    if 'read' in f.metadata:
        f.metadata['read'](name, value)
    elif 'choices' not in f.metadata:
        check_number(name, value, f)
    elif all(isinstance(known, str) for known in f.metadata['choices']):
        check_name(name, value, f.metadata['choices'])
    elif not isinstance(value, (bool, str)) or value not in f.metadata['choices']:
        raise InvalidInput(name, value, f'one of {_choices(f)}')


def check_number(name: str, value: Any, f: Field) -> None:
    """Raise InvalidInput for `name` if `value` is not a number in the declared range."""
    whole = isinstance(f.default, int)
    kinds = (int,) if whole else (int, float)
    is_kind = isinstance(value, kinds) and not isinstance(value, bool)
    if not is_kind or not f.metadata['low'] <= value <= f.metadata['high']:
        kind, unit = 'an integer' if whole else 'a number', f.metadata['unit']
        raise InvalidInput(
            name, value, f'{kind} from {values_of(f)}' + (f' [{unit}]' if unit else '')
        )


def values_of(f: Field) -> str:
    """Return the allowed values of a field: '0 to 10', 'stop, go_on', or the format of a string."""
    if 'form' in f.metadata:
        return f.metadata['form']
    if 'choices' in f.metadata:
        return _choices(f)
    low, high = f.metadata['low'], f.metadata['high']
    return f'{low} to {high}' if isinstance(f.default, int) else f'{low:g} to {high:g}'


def shown(value: Any) -> str:
    """Return a value as it is written in help texts and documents."""
    if isinstance(value, bool):
        return str(value).lower()
    return f'{value:.15g}' if isinstance(value, float) else str(value)


def _choices(f: Field) -> str:
    return ', '.join(shown(known) for known in f.metadata['choices'])


def describe(f: Field) -> str:
    """Return the meaning of a declared field with its unit, choices or format."""
    unit = f' [{f.metadata["unit"]}]' if f.metadata['unit'] else ''
    is_list = 'form' in f.metadata or ('choices' in f.metadata and not isinstance(f.default, bool))
    return f'{f.metadata["text"]}{unit}' + (f': {values_of(f)}' if is_list else '')


def help_of(kind: type, name: str) -> str:
    """Return the meaning of a declared field with unit or choices, and its default."""
    f = declaration(kind, name)
    return describe(f) + (f' (default {shown(f.default)})' if f.default != '' else '')
