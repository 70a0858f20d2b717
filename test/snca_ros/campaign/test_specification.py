"""Campaign files: products of lists, the paper's campaigns, and what is refused."""

import contextlib
from dataclasses import fields, replace
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from support.paths import CONFIG, ROOT

from sim_node.errors import InvalidInput
from sim_node.model.solver import Solver
from snca_ros.campaign.columns import settings_of
from snca_ros.campaign.results import read_rows
from snca_ros.campaign.specification import read_campaign
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.config import RunConfig

EXPERIMENTS = CONFIG / 'experiments'

GOOD = {'shape': 'worm', 'architecture': 'U-D', 'neuron_model': 'mlp'}
SHORT = '{shape: worm, architecture: U-D, neuron_model: mlp'


def runs_of(tmp_path, values):
    path = tmp_path / 'campaign.yaml'
    path.write_text(values if isinstance(values, str) else yaml.safe_dump(values))
    return read_campaign(path)


def test_the_defaults_are_those_of_evolve(tmp_path):
    named = {'shape': 'worm', 'architecture': 'U-D', 'neuron_model': 'mlp'}
    assert runs_of(tmp_path, named) == [RunConfig.named(**named)]


def test_the_papers_main_campaign():
    runs = read_campaign(EXPERIMENTS / 'paper-main.yaml')
    cases = {(run.shape, run.architecture.name, run.architecture.neuron_model) for run in runs}
    kinds = [('U-nD', 'snn-h'), ('U-D', 'mlp'), ('nU-D', 'mlp')]
    assert cases == {(s, *kind) for s in ('biped', 'comb', 'worm') for kind in kinds}
    assert len(runs) == 90
    assert [run.seed for run in runs] == [seed for seed in range(10) for _ in range(9)]
    assert {(run.episodes, run.engine, run.terrain, run.solver) for run in runs} == {
        (30_000, 'batched', 'flat', Solver(physics='reference'))
    }
    assert runs[0] == RunConfig('biped', Architecture.named('U-nD', 'snn-h'), engine='batched')
    assert runs[0].name == 'biped-U-nD-snn-h-flat-batched-reference-seed0'


def test_the_papers_second_campaign_shares_runs_of_the_first():
    first, second = (
        {run.name for run in read_campaign(EXPERIMENTS / f'paper-{name}.yaml')}
        for name in ('main', 'supplement')
    )
    assert (len(second), len(first & second)) == (180, 60)


def test_results_of_the_first_physics_are_those_of_campaigns_that_name_it():
    results = ROOT / 'results' / 'first-physics'
    campaigns = {
        'first-physics/paper-main': ('paper', 90), 'as-printed': ('as_printed', 3),
        'first-physics/paper-supplement': ('paper', 60 + 36), 'engines': ('engines', 20),
        'strategies': ('strategies', 6),
    }
    for name, (folder, n) in campaigns.items():
        runs = {run.name: run for run in read_campaign(EXPERIMENTS / f'{name}.yaml')}
        rows = {row['run']: row for row in read_rows(results / folder / 'results.csv')}
        assert len(runs.keys() & rows.keys()) == n
        for run in runs.keys() & rows.keys():
            described = settings_of(runs[run])
            assert {key: rows[run][key] for key in described} == described
    for name in ('main', 'supplement'):
        old, new = (read_campaign(EXPERIMENTS / of / f'paper-{name}.yaml')
                    for of in ('first-physics', '.'))
        assert old == [replace(run, solver=Solver(physics='first')) for run in new]


def config_of(row):
    """Return the configuration of a row of results.csv, by its columns of settings alone."""
    hidden = () if row['hidden'] == '0' else tuple(map(int, row['hidden'].split('x')))
    cell = Architecture.named(
        row['architecture'], row['neuron_model'], n_c=int(row['n_c']), hidden=hidden,
        as_printed=row['as_printed'] == 'true',
    )
    solver = Solver(
        int(row['substeps']), int(row['iterations']), row['self_collision'] == 'true',
        row['physics'],
    )
    numbers = {name: float(row[name]) for name in ('sigma', 'duration', 'transient')}
    whole = {name: int(row[name]) for name in ('episodes', 'seed', 'population', 'draw')}
    texts = {name: row[name] for name in ('terrain', 'strategy', 'engine', 'score')}
    return RunConfig(
        row['shape'], cell, solver=solver, **numbers, **whole, **texts,
        starts=int(row['evolution_starts']), faults='' if row['faults'] == 'none' else row['faults']
    )


@pytest.mark.parametrize('table', sorted((ROOT / 'results').rglob('results.csv')), ids=str)
def test_the_runs_of_committed_results_have_their_names(table):
    rows = read_rows(table)
    assert rows
    for row in rows:
        assert config_of(row).name == row['run']


def test_a_text_of_several_is_one_run_and_a_list_is_several(tmp_path):
    runs = runs_of(tmp_path, {
        **GOOD, 'shape': ['worm, comb', 'worm'], 'terrain': 'flat,uphill-10', 'starts': 2,
        'faults': ['none', 'none; loss=0.3'], 'score': 'minimum', 'evaluations': 500,
    })
    described = {(run.shape, run.faults, run.episode_set.n_episodes, run.episodes) for run in runs}
    assert described == {
        ('worm,comb', '', 8, 500), ('worm,comb', 'none;loss=0.3', 16, 500),
        ('worm', '', 4, 500), ('worm', 'none;loss=0.3', 8, 500),
    }
    drawn, = runs_of(tmp_path, {**GOOD, 'draw': 4, 'faults': 'loss=0..0.5', 'episodes': 500})
    assert drawn == RunConfig.named(
        'worm', 'U-D', 'mlp', draw=4, faults='loss=0..0.5', episodes=500
    )
    assert drawn.name == 'worm-U-D-mlp-flat-faults-loss=0..0.5-draw4-reference-episodes500-seed0'
    for run in [*runs, drawn]:
        assert config_of(settings_of(run)) == run


def test_the_small_campaign_asks_the_same_question():
    runs = read_campaign(EXPERIMENTS / 'small.yaml')
    assert len(runs) == 6
    assert {(run.architecture.name, run.architecture.neuron_model) for run in runs} == {
        ('U-nD', 'snn-h'), ('U-D', 'mlp'), ('nU-D', 'mlp')
    }


def test_cases_are_products_of_their_lists_and_the_shared_ones(tmp_path):
    runs = runs_of(tmp_path, {
        'seed': [0, 1], 'shape': ['worm', 'comb'], 'neuron_model': 'mlp', 'episodes': 50,
        'cases': [
            {'architecture': ['U-D', 'nU-D']},
            {'architecture': 'U-D', 'seed': [1, 2], 'as_printed': True, 'shape': 'worm'},
            {'architecture': 'U-D', 'seed': 0},  # again
        ],
    })
    described = [(run.shape, run.architecture.name, run.architecture.as_printed, run.seed)
            for run in runs]
    assert len(described) == len(set(described)) == 2 * 2 * 2 + 2
    assert ('worm', 'U-D', True, 2) in described
    assert ('comb', 'nU-D', False, 1) in described
    assert {run.episodes for run in runs} == {50}


@pytest.mark.parametrize(
    ('values', 'words'),
    [
        ({**GOOD, 'sead': 3}, ['sead', "did you mean 'seed'?"]),
        ({**GOOD, 'shape': ['worm', 'bipd']}, ["'bipd'", "did you mean 'biped'?"]),
        ({**GOOD, 'seed': []}, ['seed', 'at least one value']),
        ({**GOOD, 'seed': [0, -1]}, ['seed', '-1']),
        ({**GOOD, 'cases': {}}, ['cases', 'a list']),
        ({**GOOD, 'cases': []}, ['cases', 'at least one']),
        ({**GOOD, 'cases': [{'cases': []}]}, ['cases[0]']),
        ({'shape': 'worm', 'architecture': 'U-D'}, ['neuron_model', 'a value or a list']),
        ([GOOD], ['campaign', 'keys and values']),
        ('a: b: c', ['file', 'a campaign']),
        ('', ['campaign', 'keys and values']),
        ('shape: worm\nseed: 1\nseed: 2', ['seed', 'lines 2 and 3']),
        ({**GOOD, 'shape': ''}, ['morphology', "''"]),
        ({**GOOD, 'shape': 'worm,comb', 'architecture': 'nU-D'}, ['shape', 'uniform']),
        ({**GOOD, 'episodes': 9, 'evaluations': 9}, ['evaluations', 'episodes alone']),
        (f'{SHORT}, seed: 0100}}', ['seed', "'0100'"]),
        (f'{SHORT}, episodes: 1_000}}', ['episodes', "'1_000'"]),
        (f'{SHORT}, shape: 0111-11}}', ['lines 1']),
        ({**GOOD, 'seed': 2**32}, ['seed', '4294967296']),
    ],
)
def test_bad_files_are_refused(tmp_path, values, words):
    with pytest.raises(InvalidInput) as error:
        runs_of(tmp_path, values)
    assert str(error.value).startswith(str(tmp_path / 'campaign.yaml'))
    assert all(word in str(error.value) for word in words)


def test_grids_are_read_as_they_are_written(tmp_path):
    runs = runs_of(tmp_path, f'{SHORT.replace("worm", "[0111, 111, 1111-1001]")}}}')
    assert {run.shape for run in runs} == {'0111', '111', '1111-1001'}


def test_missing_file():
    with pytest.raises(InvalidInput, match=r'nowhere\.yaml'):
        read_campaign(Path('nowhere.yaml'))


@given(
    key=st.sampled_from([*GOOD, 'seed', 'engine', 'terrain', 'duration', 'as_printed', 'cases']),
    value=st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner),
        max_leaves=4,
    ),
)
def test_any_value_is_taken_or_refused(tmp_path_factory, key, value):
    path = tmp_path_factory.getbasetemp() / 'any.yaml'
    path.write_text(yaml.safe_dump({**GOOD, key: value}))
    with contextlib.suppress(InvalidInput):
        assert all(isinstance(run, RunConfig) for run in read_campaign(path))


def test_every_setting_is_in_a_runs_name():
    plain = RunConfig('worm', Architecture.named('U-D', 'mlp'))
    others = {
        'shape': 'comb', 'terrain': 'uphill-10', 'episodes': 500, 'seed': 1, 'population': 8,
        'sigma': 0.3500001, 'duration': 20.0, 'transient': 1.0, 'engine': 'batched',
        'strategy': 'cma', 'architecture': Architecture.named('nU-D', 'mlp'),
        'solver': Solver(physics='first'), 'faults': 'loss=0.3', 'starts': 2, 'draw': 3,
        'score': 'minimum',
    }
    assert others.keys() == {f.name for f in fields(RunConfig)} - {'material', 'task'}
    cells = [
        replace(plain.architecture, **change) for change in
        ({'n_c': 2, 'hidden': None}, {'hidden': (5,)}, {'hidden': (5, 3)}, {'hidden': ()},
         {'as_printed': True}, {'neuron_model': 'snn'}, {'directional': False})
    ]
    runs = [
        plain, *(replace(plain, **{key: value}) for key, value in others.items()),
        *(replace(plain, architecture=cell) for cell in cells),
    ]
    assert len({run.name for run in runs}) == len(runs)
    assert plain.name == 'worm-U-D-mlp-flat-reference-seed0'
