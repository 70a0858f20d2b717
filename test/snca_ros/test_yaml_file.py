"""Settings in YAML files are what their text says, or they are refused."""

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sim_node.errors import InvalidInput
from snca_ros.yaml_file import parse_yaml, read_yaml, yaml_text


@pytest.mark.parametrize(
    ('text', 'value'),
    [
        ('0', 0), ('-0', 0), ('17', 17), ('+17', 17), ('-3', -3), ('0.35', 0.35), ('1.', 1.0),
        ('.5', 0.5), ('-.5', -0.5), ('1e3', 1e3), ('1.5e-3', 1.5e-3), ('1E+3', 1e3),
        ('.inf', float('inf')), ('true', True), ('no', False), ('on', True), ('~', None),
        ('', None), ('null', None),
    ],
)
def test_numbers_and_words_with_one_meaning(text, value):
    found = parse_yaml(f'key: {text}')['key']
    assert (found, type(found)) == (value, type(value))


@pytest.mark.parametrize(
    'text',
    ['0111', '0100', '00', '-01', '0x10', '0b11', '0o7', '1_000', '1:30', '190:20:30.15', '01.5',
     '1111-11-11', '2001-12-14t21:59:43', '1111-1001', '1.2.3', '+', '-1-1', '1e', '.'],
)
def test_what_yaml_reads_as_another_number_or_date_is_text(text):
    assert parse_yaml(f'key: {text}') == {'key': text}
    assert parse_yaml(f'[{text}]') == [text]


@pytest.mark.parametrize(
    'text', ['seed: 1\nseed: 2', '"seed": 1\nseed: 1', 'a: {seed: 1,\n    seed: 2}']
)
def test_key_that_is_there_twice_is_refused_with_file_and_lines(tmp_path, text):
    (tmp_path / 'file.yaml').write_text(text)
    with pytest.raises(InvalidInput, match=r'file\.yaml: seed: got .*lines 1 and 2.*once'):
        read_yaml(tmp_path / 'file.yaml', 'settings')


def test_merged_keys_may_be_given_again():
    assert parse_yaml('{a: &a {x: 1, y: 2}, b: {<<: *a, x: 3}}')['b'] == {'x': 3, 'y': 2}


@given(
    st.dictionaries(
        st.sampled_from(['shape', 'seed', 'x']),
        st.integers() | st.booleans() | st.none() | st.floats(allow_nan=False)
        | st.from_regex(r'\A[01:_x.-]{1,8}\Z'),
    )
)
def test_what_is_written_is_read(values):
    assert parse_yaml(yaml_text(values)) == values
    assert parse_yaml(yaml.safe_dump(values)) == values
