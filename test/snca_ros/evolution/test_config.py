"""The config file of a run: written, read, damaged."""

import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st
from support.evolve import assert_one_line, contents_of, evolve

from sim_node.errors import InvalidInput
from sim_node.model.body_file import MOST_PARAMETERS
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.config import RunConfig

GOOD = yaml.safe_load(RunConfig('worm', Architecture.named('U-nD', 'snn-h')).to_yaml())


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
        ('shape: worm\narchitecture: {}', ['terrain', 'None']),
        ('shape: worm\nshape: biped', ['shape', 'lines 1 and 2', 'once']),
        ('shape: [', ['file']),
        ('a: b: c', ['file']),
        ('\t', ['file']),
        ('!!python/object/apply:os.getcwd []', ['file']),
        ('shape: 2001-99-99', ['architecture', 'None']),
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
    'episodes': [None, 0, 1.5, True, '10', 10**400],
    'seed': [None, -1, 1.5, True, 2**32],
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
    'faults': [None, 3, ['loss=0.3'], 'los=0.3', 'loss=1.5', 'loss=0..0.5', 'x.yaml', 'none;'],
    'starts': [None, -1, True, 10_001, '5'],
    'draw': [None, -1, 1.5, 10_001],
    'score': [None, 3, 'median', 'quantile-1.5', 'quantile-'],
    'other': [None, 1],
    3: [None],
}
_SAID = {'shape': 'morphology', 'faults': 'loss'}
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
        config = RunConfig(shape, architecture, 'hilly-0.5-10-3', seed=2**32 - 1, sigma=0.1)
        path.write_text(config.to_yaml())
        assert RunConfig.from_yaml(path) == config


def test_config_that_was_cut_is_refused(tmp_path):
    path, text = tmp_path / 'config.yaml', RunConfig.named().to_yaml()
    for end in range(len(text) - 1):  # without its last line break it is whole
        path.write_text(text[:end])
        with pytest.raises(InvalidInput, match=r'config\.yaml: '):
            RunConfig.from_yaml(path)
    later = "task: walk\nfaults: ''\nstarts: 0\ndraw: 0\nscore: mean\n"
    assert text.startswith(later)
    former = text.removeprefix(later).replace('episodes: 30000', 'evaluations: 30000')
    path.write_text(former)  # as earlier versions wrote it
    assert RunConfig.from_yaml(path) == RunConfig.named()
    path.write_text(f'{text}evaluations: 30000\n')
    with pytest.raises(InvalidInput, match='evaluations: got 30000, expected episodes alone'):
        RunConfig.from_yaml(path)


def test_numbers_and_texts_of_numpy_are_written_as_those_of_python():
    config = RunConfig.named(np.str_('worm'), sigma=np.float64(0.1))
    assert config.to_yaml() == RunConfig.named('worm', sigma=0.1).to_yaml()


def test_more_parameters_than_a_controller_file_holds_are_refused():
    case = {'shape': 'biped', 'architecture': 'nU-nD', 'neuron_model': 'mlp'}
    assert RunConfig.named(**case, hidden=(512, 512)).n_parameters < MOST_PARAMETERS
    with pytest.raises(InvalidInput, match=r'parameters: got .*, expected at most 8388608'):
        RunConfig.named(**case, hidden=(1024, 1024))


def test_names_of_runs_fit_into_the_names_of_their_files():
    rows = ['1' * 64] * 64
    grids = ['-'.join(rows), '-'.join([*rows[:-1], '1' * 63 + '0'])]
    names = {RunConfig.named(grid, seed=seed).name for grid in grids for seed in (0, 1)}
    assert len(names) == 4
    assert max(map(len, names)) <= 255 - len('-robust.npz')


def test_seeds_have_random_numbers_of_their_own():
    seeds = [*range(40), 2**16, 2**31, 2**32 - 1]
    first = [RunConfig.named('worm', seed=seed).new_strategy().ask()[0, 0] for seed in seeds]
    assert len(set(first)) == len(seeds)
    # A generator takes seeds from 2^32 on as two numbers, as which it takes seed and generation.
    with pytest.raises(InvalidInput, match='seed: got 4294967296, expected an integer from 0 to'):
        RunConfig.named('worm', seed=2**32)
