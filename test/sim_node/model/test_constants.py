"""Declared options: their checks, reading from text, and descriptions."""

from dataclasses import dataclass, fields

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_node.errors import InvalidInput
from sim_node.model.constants import (
    Checked,
    choice,
    constant,
    declaration,
    declared,
    describe,
    flag,
    help_of,
    same_as,
    text_value,
    value_of,
    values_of,
)


def read_even(name, value):
    if not isinstance(value, str) or len(value) % 2:
        raise InvalidInput(name, value, 'a text of even length')


@dataclass(frozen=True)
class Oven(Checked):
    heat: float = constant(200.0, 0.0, 300.0, 'temperature', 'C')
    trays: int = constant(1, 1, 4, 'trays in use')
    mode: str = choice('fan', ('fan', 'grill'), 'how it heats')
    door: bool | str = choice(False, (False, True, 'ajar'), 'whether it is open')
    light: bool = flag(True, 'lit')
    label: str = text_value('', 'name', 'any text')
    pairs: str = text_value('ab', 'letters', 'pairs of letters', read_even)
    plain: int = 3


@dataclass(frozen=True)
class Kitchen(Checked):
    trays: int = same_as(Oven, 'trays')


def test_a_field_without_a_declaration_is_not_checked():
    assert [f.name for f in declared(Oven)] == [f.name for f in fields(Oven)][:-1]
    assert Oven(plain='x').plain == 'x'


@pytest.mark.parametrize(('name', 'good', 'bad', 'expected'), [
    ('heat', [0, 300.0, 21.5], [-1e-9, 300.1, float('nan'), True, '20'],
     r'a number from 0 to 300 \[C\]'),
    ('trays', [1, 4], [0, 5, 2.0, True, '2', None], 'an integer from 1 to 4'),
    ('mode', ['grill'], ['gril', '', 3, None], 'one of fan, grill'),
    ('door', [True, 'ajar'], ['open', 1, 0, None, 2.5], 'one of false, true, ajar'),
    ('light', [False, True], ['true', 1, 0], 'one of false, true'),
    ('label', ['', 'x'], [None, 3, b''], 'a string'),
    ('pairs', ['', 'abcd'], ['a', None, 3], 'a text of even length'),
])
def test_valid_values_are_accepted_and_invalid_ones_rejected(name, good, bad, expected):
    for value in good:
        assert getattr(Oven(**{name: value}), name) == value
    for value in bad:
        with pytest.raises(InvalidInput, match=f'^{name}: got .*, expected {expected}'):
            Oven(**{name: value})


@given(st.text() | st.integers().map(str) | st.floats().map(str))
def test_any_text_is_read_or_rejected(text):
    for f in declared(Oven):
        try:
            value = value_of(f'--{f.name}', text, f)
        except InvalidInput as error:
            refused = error
        else:
            assert Oven(**{f.name: value})
            continue
        assert refused.field == f'--{f.name}'


@pytest.mark.parametrize(('name', 'text', 'value'), [
    ('heat', '20', 20.0), ('trays', '2', 2), ('mode', 'grill', 'grill'), ('pairs', '12', '12'),
])
def test_text_is_converted_to_the_type_of_its_field(name, text, value):
    found = value_of(name, text, declaration(Oven, name))
    assert (found, type(found)) == (value, type(value))


def test_same_as_copies_the_declaration():
    assert declaration(Kitchen, 'trays').metadata == declaration(Oven, 'trays').metadata
    assert Kitchen().trays == Oven().trays
    with pytest.raises(InvalidInput, match='trays: got 5, expected an integer from 1 to 4'):
        Kitchen(5)


@pytest.mark.parametrize(('name', 'description', 'values', 'default'), [
    ('heat', 'temperature [C]', '0 to 300', '200'),
    ('trays', 'trays in use', '1 to 4', '1'),
    ('mode', 'how it heats: fan, grill', 'fan, grill', 'fan'),
    ('door', 'whether it is open', 'false, true, ajar', 'false'),
    ('light', 'lit', 'false, true', 'true'),
    ('pairs', 'letters: pairs of letters', 'pairs of letters', 'ab'),
])
def test_descriptions(name, description, values, default):
    f = declaration(Oven, name)
    assert (describe(f), values_of(f)) == (description, values)
    assert help_of(Oven, name) == f'{description} (default {default})'


def test_help_omits_an_empty_default():
    assert help_of(Oven, 'label') == 'name: any text'
