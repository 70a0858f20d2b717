"""Faults of a set of episodes: their texts, in which numbers may be ranges."""

import re
from collections.abc import Callable
from dataclasses import asdict
from itertools import product
from typing import Any

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.constants import declared
from snca_ros.faults import NO_FAULTS, Faults, parse_faults

NONE = '', 'none'
"""Texts for no faults."""

_NUMBER = r'\d+(?:\.\d+)?'
_RANGE = re.compile(rf'({_NUMBER})\.\.({_NUMBER})')
_WHOLE = {f.name for f in declared(Faults) if isinstance(f.default, int)}
_MOST_RANGES = 3  # in the text of one fault


def has_ranges(text: str) -> bool:
    """Return whether a number in a text of faults is a range."""
    return _RANGE.search(text) is not None


def faults_at(text: str, draw: Callable[[], float]) -> Faults:
    """Return the faults of a text, with a number drawn for each of its ranges.

    Args:
        text: as for `parse_faults`, in which numbers may be ranges FROM..TO; '' or 'none'.
        draw: returns numbers from 0 to 1, which stand for FROM and TO of a range; whole numbers,
            of `delay`, have equal shares of that interval.

    Raises:
        InvalidInput: a value is invalid.
    """
    if text in NONE:
        return NO_FAULTS
    if '=' not in text:  # else it would be the name of a file, which can change
        raise InvalidInput('faults', text, 'name=value,... or none')
    pairs = []
    for pair in text.split(','):
        name, equals, value = pair.partition('=')
        ranges = list(_RANGE.finditer(value))
        numbers = [_number(name, found, draw()) for found in ranges]
        for found, number in reversed([*zip(ranges, numbers, strict=True)]):
            value = f'{value[: found.start()]}{number}{value[found.end() :]}'
        pairs.append(f'{name}{equals}{value}')
    return parse_faults(','.join(pairs))


def _number(name: str, found: re.Match, share: float) -> str:
    """Return the number at a share of a range, as text without an exponent."""
    low, high = float(found[1]), float(found[2])
    if not low < high:
        raise InvalidInput('faults', f'{name}={found[0]}', 'a range FROM..TO, FROM below TO')
    if name not in _WHOLE:
        return f'{low + share * (high - low):.12f}'
    if not (low.is_integer() and high.is_integer()):
        raise InvalidInput('faults', f'{name}={found[0]}', 'a range of whole numbers')
    return str(min(int(high), int(low) + int(share * (high - low + 1.0))))


def check_ranges(text: str) -> None:
    """Check the faults of a text at the ends and in the middle of each of their ranges.

    Raises:
        InvalidInput: a value is invalid, or a fault has too many ranges.
    """
    for pair in text.split(',') if text not in NONE else ():
        n = len(_RANGE.findall(pair))
        if n > _MOST_RANGES:
            raise InvalidInput('faults', pair, f'at most {_MOST_RANGES} ranges')
        for shares in product((0.0, 0.5, 1.0), repeat=n):
            faults_at(pair, iter(shares).__next__)
    faults_at(text, lambda: 0.0)


def text_of(faults: str | Faults) -> str:
    """Return the text of faults, name=value,..., also of those in a YAML file; 'none' for none.

    Args:
        faults: faults, their text, or the name of a YAML file.

    Raises:
        InvalidInput: there is no such file, or it is invalid.
    """
    if isinstance(faults, str):
        if faults in NONE or '=' in faults or ';' in faults:
            return faults
        faults = parse_faults(faults)
    values = {name: value for name, value in asdict(faults).items()
              if value != getattr(NO_FAULTS, name)}
    return ','.join(f'{name}={_plain(value)}' for name, value in values.items()) or 'none'


def _plain(value: Any) -> str:
    return np.format_float_positional(value, trim='-') if isinstance(value, float) else str(value)


def compact(value: Any, separator: str = ',') -> Any:
    """Return a text without spaces, or the texts of a list joined; other values as they are."""
    if isinstance(value, (list, tuple)) and all(isinstance(one, str) for one in value):
        value = separator.join(value)
    return value.replace(' ', '') if isinstance(value, str) else value
