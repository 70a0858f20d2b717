"""Constants that are declared once: default, range or choices, unit and meaning.

The declaration is a dataclass field. It serves the check in the constructor, the descriptors of
ROS parameters, the help of commands and the documentation.
"""

from collections.abc import Collection
from dataclasses import Field, field, fields
from typing import Any

from sim_node.errors import InvalidInput, check_name


def constant(default: Any, low: float, high: float, text: str, unit: str = '') -> Any:
    """Declare a number, whole if `default` is: default, range (inclusive), meaning and unit."""
    return field(default=default, metadata={'low': low, 'high': high, 'text': text, 'unit': unit})


def choice(default: Any, choices: Collection, text: str) -> Any:
    """Declare a constant that is one of a few values, texts or truth values, or of a registry."""
    return field(default=default, metadata={'choices': choices, 'text': text, 'unit': ''})


def declared(kind: type | Any) -> tuple[Field, ...]:
    """Return the fields of a dataclass, or of an instance, that are declared here."""
    return tuple(f for f in fields(kind) if 'text' in f.metadata)


def check_declared(instance: Any, where: str = '') -> None:
    """Check all declared fields of a dataclass.

    Args:
        instance: of the dataclass.
        where: before the name of a field in errors, such as 'material.'.

    Raises:
        InvalidInput: a value is of another kind, not finite, or out of its range or choices.
    """
    for f in declared(instance):
        value = getattr(instance, f.name)
        if 'choices' not in f.metadata:
            check_number(f'{where}{f.name}', value, f)
        elif all(isinstance(known, str) for known in f.metadata['choices']):
            check_name(f'{where}{f.name}', value, f.metadata['choices'])
        elif not isinstance(value, (bool, str)) or value not in f.metadata['choices']:
            names = ', '.join(str(known).lower() for known in f.metadata['choices'])
            raise InvalidInput(f'{where}{f.name}', value, f'one of {names}')


def check_number(name: str, value: Any, declaration: Field) -> None:
    """Raise InvalidInput if `value` is not such a number as its field declares."""
    whole = isinstance(declaration.default, int)
    meta, kinds = declaration.metadata, (int,) if whole else (int, float)
    is_kind = isinstance(value, kinds) and not isinstance(value, bool)
    if not is_kind or not meta['low'] <= value <= meta['high']:
        kind, unit = 'an integer' if whole else 'a number', meta['unit'] and f' [{meta["unit"]}]'
        raise InvalidInput(name, value, f'{kind} from {meta["low"]:g} to {meta["high"]:g}{unit}')


def help_of(kind: type, name: str) -> str:
    """Return the meaning of a declared field with unit or choices, and its default."""
    (f,) = (f for f in declared(kind) if f.name == name)
    unit = f' [{f.metadata["unit"]}]' if f.metadata['unit'] else ''
    choices = f': {", ".join(f.metadata["choices"])}' if 'choices' in f.metadata else ''
    default = f'{f.default:.15g}' if isinstance(f.default, (int, float)) else f.default
    return f'{f.metadata["text"]}{unit}{choices} (default {default})'
