"""The config file of a run: written, read, damaged."""

import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from support.evolve import assert_one_line, contents_of, evolve

from sim_node.errors import InvalidInput
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.config import RunConfig

GOOD = {'shape': 'worm', 'architecture': Architecture.named('U-nD', 'snn-h').to_dict()}


def test_damaged_config_as_a_process(begun):
    path = begun / 'config.yaml'
    path.write_text(path.read_text().replace('population', 'popluation'))
    before = contents_of(begun)
    hint = "did you mean 'population'?"
    assert_one_line(evolve('--resume', begun), str(path), "'popluation'", hint)
    assert contents_of(begun) == before


@pytest.mark.parametrize(
    ('text', 'words'),
    [
        ('', ['config', 'None']),
        ('shape', ['config', "'shape'"]),
        ('[1, 2]', ['config']),
        ('shape: worm', ['architecture', 'None']),
        ('architecture: {}', ['shape', 'None']),
        ('shape: worm\narchitecture: 3', ['architecture', '3']),
        ('shape: worm\narchitecture: {}', ['architecture.uniform', 'None']),
        ('shape: worm\narchitecture: {1: 2}', ['architecture', '1']),
        ('shape: [', ['file']),
        ('a: b: c', ['file']),
        ('\t', ['file']),
        ('!!python/object/apply:os.getcwd []', ['file']),
        ('shape: 2001-99-99', ['file']),
        (f'seed: {"9" * 5000}', ['file']),
        ('[' * 5000, ['file']),
        ('shape: \x00', ['file']),
    ],
)
def test_damaged_config(begun, here, text, words):
    (begun / 'config.yaml').write_text(text)
    before = contents_of(begun)
    here.refuses('--resume', begun, words=[str(begun / 'config.yaml'), *words])
    assert contents_of(begun) == before


@pytest.mark.parametrize('content', [b'\xff\xfe\x00', bytes(100), b'shape: \xe9'])
def test_config_that_is_no_text(begun, here, content):
    (begun / 'config.yaml').write_bytes(content)
    here.refuses('--resume', begun, words=[str(begun / 'config.yaml'), 'file'])


def test_config_that_is_a_folder(begun, here):
    (begun / 'config.yaml').unlink()
    (begun / 'config.yaml').mkdir()
    here.refuses('--resume', begun, words=[str(begun / 'config.yaml'), 'file'])


WRONG = {
    'shape': [None, 11111, ['worm'], 'bipd'],
    'terrain': [None, 3, 'hily-1-10-0'],
    'evaluations': [None, 0, 1.5, True, '10', 10**400],
    'seed': [None, -1, 1.5, True, 2**63],
    'population': [None, 3, 36.0, False],
    'sigma': [None, 0, -1, float('nan'), 'x', True, 10**400],
    'duration': [None, 0, float('inf'), '30'],
    'transient': [None, -1, 31, float('nan')],
    'engine': [None, 3, [], 'batch'],
    'strategy': [None, 3, [], 'CMA-ES'],
    'material': [None, 3, [], {'gravity': 'x'}, {'gravity': -1}, {'gravty': 1}, {1: 2}],
    'solver': [None, 3, [], {'substeps': 0}, {'substeps': 1.0}, {'nothing': 1}, {1: 2}],
    'architecture': [
        None, 3, [], {}, {**GOOD['architecture'], 'n_c': 0}, {**GOOD['architecture'], 'x': 1},
        {**GOOD['architecture'], 'neuron_model': 'snn_h'},
    ],
    'other': [None, 1],
    3: [None],
}
_SAID = {'shape': 'morphology'}
_INNER = {'gravity', 'gravty', 'substeps', 'nothing', 'n_c', 'x', 'neuron_model'}


@pytest.mark.parametrize('key', WRONG)
def test_wrong_value_in_the_config_is_named(tmp_path, key):
    path = tmp_path / 'config.yaml'
    for value in WRONG[key]:
        path.write_text(yaml.safe_dump({**GOOD, key: value}))
        with pytest.raises(InvalidInput) as caught:
            RunConfig.from_yaml(path)
        text = str(caught.value)
        assert text.startswith(f'{path}: ')
        assert '\n' not in text
        inner = _INNER & set(value) if isinstance(value, dict) else set()
        names = [str(key), _SAID.get(key, '-'), *inner]
        assert any(name in text.removeprefix(str(path)) for name in names)


@settings(max_examples=200)
@given(
    key=st.sampled_from(sorted(RunConfig.__dataclass_fields__)),
    value=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=20),
        lambda inner: st.lists(inner, max_size=3)
        | st.dictionaries(st.text(max_size=9) | st.integers(), inner, max_size=3),
    ),
)
def test_any_value_in_a_config_is_taken_or_refused(key, value):
    try:
        config = RunConfig.from_dict({**GOOD, key: value})
    except InvalidInput as error:
        complaint = str(error)
    else:
        complaint = ' '
        assert RunConfig.from_dict(yaml.safe_load(config.to_yaml())) == config
    assert complaint
    assert '\n' not in complaint


@settings(max_examples=100)
@given(text=st.text(max_size=60))
def test_any_text_as_config_is_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp('any') / 'config.yaml'
    path.write_bytes(text.encode('utf-8', 'surrogatepass'))
    with pytest.raises(InvalidInput, match=r'config\.yaml: '):
        RunConfig.from_yaml(path)


@pytest.mark.parametrize('key', ['shape', 'terrain', 'seed', 'architecture', 'material', 'other'])
def test_text_that_grows_without_end_is_refused_shortly(tmp_path, key):
    """Each line names the one before ten times: 10^30 words."""
    lines = ['a0: &a0 [x, x]']
    lines += [f'a{n}: &a{n} [{", ".join([f"*a{n - 1}"] * 10)}]' for n in range(1, 30)]
    grown = '\n'.join('  ' + line for line in lines)
    path = tmp_path / 'config.yaml'
    path.write_text(f'{key}:\n{grown}\n')
    with pytest.raises(InvalidInput, match=r'config\.yaml: ') as refusal:
        RunConfig.from_yaml(path)
    assert len(str(refusal.value)) < 1000
    values = yaml.safe_load(path.read_text())
    with pytest.raises(InvalidInput) as refusal:
        RunConfig.from_dict({**GOOD, **values})
    assert len(str(refusal.value)) < 1000


def test_config_goes_both_ways(tmp_path):
    path = tmp_path / 'config.yaml'
    for shape, model in (('biped', 'snn'), ('11111', 'mlp'), ('1001-1111', 'snn-h')):
        architecture = Architecture.named('nU-D', model, n_c=2, hidden=(5, 3), as_printed=True)
        config = RunConfig(shape, architecture, 'hilly-0.5-10-3', seed=2**63 - 1, sigma=0.1)
        path.write_text(config.to_yaml())
        assert RunConfig.from_yaml(path) == config
