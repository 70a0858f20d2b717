"""The tables of the first results: every row of them in today's columns, and nothing guessed."""

import contextlib
import csv

import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.made_up_results import first_row, made_up_run, write_results

from sim_node.errors import InvalidInput
from sim_node.model.terrain import UNSEEN_KINDS
from snca_ros.campaign.columns import COLUMNS, MAY_BE_EMPTY, SETTINGS, settings_of
from snca_ros.campaign.first_results import converted
from snca_ros.campaign.results import Results, read_rows

runs = st.builds(
    made_up_run,
    shape=st.sampled_from(['biped', 'comb-9x3', '1111-1001', 'worm-3x1']),
    architecture=st.sampled_from(['U-nD', 'U-D', 'nU-D', 'nU-nD']),
    neuron_model=st.sampled_from(['mlp', 'snn', 'snn-h']),
    seed=st.integers(0, 10**6),
    episodes=st.integers(1, 10**9),
    as_printed=st.booleans(),
    engine=st.sampled_from(['pymunk', 'batched']),
    physics=st.just('first'),
    terrain=st.sampled_from(['flat', 'hilly-0.5-10-0', 'steppy-1-20-3', 'uphill-10']),
    strategy=st.sampled_from(['es', 'cma']),
    population=st.integers(4, 100_000),
    sigma=st.floats(1e-9, 100.0).map(lambda x: float(f'{x:.15g}')),
    duration=st.floats(5.1, 3600.0).map(lambda x: float(f'{x:.15g}')),
    transient=st.floats(0.0, 5.0).map(lambda x: float(f'{x:.15g}')),
)


def row_of(config, **numbers):
    like = first_row(**numbers)
    cell = config.architecture
    return {
        **like, 'run': config.name, 'shape': config.shape, 'architecture': cell.name,
        'neuron_model': cell.neuron_model, 'as_printed': str(cell.as_printed).lower(),
        'seed': str(config.seed), 'engine': config.engine, 'n_evaluations': str(config.episodes),
    }


@given(runs)
def test_all_settings_come_back_out_of_a_row_and_its_name(config):
    row = converted(row_of(config))
    assert tuple(row) == COLUMNS
    assert {name: row[name] for name in SETTINGS} == settings_of(config)
    assert row['physics'] == 'first'


@pytest.mark.parametrize('engine', ['pymunk', 'batched'])
def test_numbers_stand_under_their_own_names_and_others_are_empty(engine):
    first = row_of(made_up_run(engine=engine, physics='first'))
    row = converted(first)
    own, other = ('5.0', '6.0') if engine == 'pymunk' else ('6.0', '5.0')
    assert (row['v_x_end'], row['v_x_other'], row['chosen_by']) == (own, other, 'pymunk')
    assert (row['terrain_set'], row['starts']) == ('seed-0', '1-20')
    assert (row['v_x_pushed_mean'], row['v_x_pushed_std']) == ('4.0', '0.5')
    assert [row[kind] for kind in UNSEEN_KINDS] == [str(i) for i in range(16)]
    assert {column for column, value in row.items() if not value} == {*MAY_BE_EMPTY} - {'v_x_other'}


@pytest.mark.parametrize(
    ('change', 'words'),
    [
        ({'run': 'biped-U-nD-snn-h-flat-batched-cmaes-seed0'}, ['terrain', "'cmaes'"]),
        ({'run': 'biped-U-nD-snn-h-flat-seed0'}, ['run', 'biped-U-nD-snn-h-flat-batched-seed0']),
        ({'run': 'biped-U-nD-snn-h-flat-batched-sigmax-seed0'}, ['run', 'a number after sigma']),
        ({'run': 'x'}, ['run', "'x'", 'biped-U-nD-snn-h-...-seed0']),
        ({'n_evaluations': '29999'}, ['run', 'with 30000 evaluations']),
        ({'engine': 'batch'}, ['engine', "did you mean 'batched'?"]),
        ({'shape': 'worm'}, ['run', 'worm-U-nD-snn-h-...-seed0']),
        ({'seed': '1'}, ['run', '-seed1']),
        ({'starts': 'many'}, ['starts', 'a whole number']),
        ({'v_x_starts_mean': ''}, ['v_x_starts_mean', 'a number']),
    ],
)
def test_rows_that_do_not_agree_with_their_names_are_refused(tmp_path, change, words):
    folder = write_results(tmp_path / 'first', [first_row()])
    with (folder / 'results.csv').open('w', newline='') as file:
        writer = csv.DictWriter(file, list(first_row()))
        writer.writeheader()
        writer.writerow(first_row() | change)
    with pytest.raises(InvalidInput) as error:
        read_rows(folder / 'results.csv')
    assert str(error.value).startswith(str(folder / 'results.csv'))
    assert '\n' not in str(error.value)
    assert all(word in str(error.value) for word in words)


@given(st.text(max_size=40) | st.from_regex(r'biped-U-nD-snn-h(-[a-z0-9.+]*){0,5}-seed0'))
def test_any_name_is_taken_or_refused(name):
    with contextlib.suppress(InvalidInput):
        row = converted(first_row() | {'run': name})
        assert row['run'] == name == first_row()['run']


def test_a_campaign_finds_the_runs_of_a_first_table_done(tmp_path):
    folder = write_results(tmp_path / 'first', [first_row(), first_row('worm')])
    before = (folder / 'results.csv').read_bytes()
    results = Results(folder)
    results.close()
    assert results.rows.keys() == {
        made_up_run(shape, physics='first').name for shape in ('biped', 'worm')
    }
    assert (folder / 'results.csv').read_bytes() == before
