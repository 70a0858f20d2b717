"""Tables of results joined, types distinguished, and what is missing or may mislead."""

import numpy as np
import pytest
import yaml
from support.comparison import SNCA, cases_of
from support.made_up_results import first_row, made_up_row, paper_rows, write_results

from sim_node.errors import InvalidInput
from snca_ros.comparison.figures import draw_all
from snca_ros.comparison.pairwise import contrasts
from snca_ros.comparison.runs import (
    ControllerType,
    known_measures,
    missing_runs,
    read_cases,
    warnings,
)
from snca_ros.comparison.tables import (
    champions_table,
    speeds_table,
    vibration_table,
)


def test_names_are_those_of_the_paper(tmp_path):
    cases = cases_of(tmp_path, *reversed(paper_rows(1)), made_up_row(as_printed=True))
    assert list(cases) == ['biped', 'comb', 'worm']
    assert list(map(str, cases['comb'])) == ['U-nD SNN-H', 'U-D MLP', 'nU-D MLP']
    assert list(map(str, cases['biped']))[-1] == 'U-nD SNN-H as printed'


def test_tables_are_joined_and_a_shared_run_counts_once(tmp_path):
    main = write_results(tmp_path / 'main', paper_rows(2, ('biped',)))
    more = [made_up_row(neuron_model='snn'), made_up_row(seed=1), made_up_row(seed=2)]
    cases = read_cases([main, write_results(tmp_path / 'more', more)])
    assert [run.row['seed'] for run in cases['biped'][SNCA]] == ['0', '1', '2']
    assert len(cases['biped'][ControllerType('U-nD', 'snn')]) == 1


def test_a_campaign_picks_its_runs_of_a_shared_table(tmp_path):
    more = [made_up_row(neuron_model='snn'), made_up_row(seed=5)]
    results = write_results(tmp_path / 'results', [*paper_rows(2), *more])
    file = tmp_path / 'campaign.yaml'
    file.write_text(yaml.safe_dump({
        'shape': 'biped', 'seed': [0, 5], 'architecture': 'U-nD', 'neuron_model': ['snn-h', 'snn'],
        'engine': 'batched',
    }))
    cases = read_cases([results], [file])
    assert {shape: list(map(str, types)) for shape, types in cases.items()} == {
        'biped': ['U-nD SNN-H', 'U-nD SNN']
    }
    assert [run.row['seed'] for run in cases['biped'][SNCA]] == ['0', '5']
    file.write_text(file.read_text().replace('biped', 'worm').replace('U-nD', 'U-D'))
    with pytest.raises(InvalidInput, match=r'results: .*at least one finished run of .*campaign'):
        read_cases([results], [file])


def test_tables_that_do_not_agree_are_refused(tmp_path):
    one = write_results(tmp_path / 'one', [made_up_row()])
    two = write_results(tmp_path / 'two', [made_up_row(v_x_end=1.0)])
    expected = r'two/results.csv: run: .*the same row as in .*one/results.csv'
    with pytest.raises(InvalidInput, match=expected):
        read_cases([one, two])


def test_equal_seeds_and_budgets_give_no_warning(tmp_path):
    cases = cases_of(tmp_path, *paper_rows(3))
    assert warnings(cases) == []
    assert missing_runs(cases, []) == []


@pytest.mark.parametrize(
    ('more', 'words'),
    [
        (made_up_row(neuron_model='snn'), 'U-nD SNN: 1 seed, too few'),
        (made_up_row(seed=3, episodes=500), 'unequal budgets'),
        (made_up_row(seed=3, v_x_unseen=-np.inf), 'U-nD SNN-H: 1 of 4 runs diverged'),
    ],
)
def test_what_may_mislead_is_told(tmp_path, more, words):
    (line,) = warnings(cases_of(tmp_path, *paper_rows(3, ('biped',)), more))
    assert line.startswith('biped')
    assert words in line


def test_unequal_budgets_are_told_with_their_numbers(tmp_path):
    rows = [made_up_row(seed=s) for s in range(3)]
    rows += [made_up_row('biped', 'U-D', 'mlp', s, episodes=500 + 36 * s) for s in range(3)]
    assert warnings(cases_of(tmp_path, *rows)) == [
        'biped: unequal budgets: 3 seeds × 30,000 episodes of U-nD SNN-H; '
        '3 seeds × 500 to 572 episodes of U-D MLP'
    ]


def test_as_printed_is_a_type_of_its_own_and_no_other_setting(tmp_path):
    rows = [made_up_row(seed=s, as_printed=p) for s in range(3) for p in (False, True)]
    assert warnings(cases_of(tmp_path, *rows)) == []


def test_runs_of_other_settings_stand_apart(tmp_path):
    rows = [
        made_up_row(seed=s, engine=engine) for s in range(3) for engine in ('pymunk', 'batched')
    ]
    cases = cases_of(tmp_path, *rows)
    assert [(str(c), len(runs)) for c, runs in cases['biped'].items()] == [
        ('U-nD SNN-H, batched', 3), ('U-nD SNN-H, pymunk', 3)
    ]
    assert warnings(cases) == ['biped: runs of unequal settings: batched, pymunk']
    assert missing_runs(cases, []) == []


def test_missing_runs_are_named(tmp_path):
    cases = cases_of(tmp_path, *paper_rows(2, ('biped',)), made_up_row('worm'))
    assert missing_runs(cases, []) == ['worm: no run yet of U-D MLP, nU-D MLP']
    file = tmp_path / 'campaign.yaml'
    file.write_text(yaml.safe_dump({
        'shape': ['biped', 'comb'], 'seed': [0, 1, 2], 'neuron_model': 'mlp',
        'architecture': ['U-D', 'nU-D'], 'engine': 'batched',
    }))
    assert missing_runs(cases, [file]) == [
        'biped: only 2 of 3 runs of U-D MLP, nU-D MLP', 'comb: no run yet of U-D MLP, nU-D MLP'
    ]


@pytest.mark.parametrize(
    ('settings', 'named'),
    [
        (({'terrain': 'hilly-10-1-0'}, {'terrain': 'hilly-1-10-0'}),
         ['hilly-1-10-0', 'hilly-10-1-0']),
        (({'sigma': 1e-05}, {}), ['sigma0.35', 'sigma1e-05']),
        (({'strategy': 'cma'}, {'terrain': 'uphill-10'}), ['flat cma', 'uphill-10 es']),
        (({'physics': 'first'}, {}), ['first-physics', 'reference-physics']),
        (({'population': 8, 'duration': 15, 'transient': 2}, {}),
         ['population36 duration30 transient5', 'population8 duration15 transient2']),
        (({}, {}), ['']),
    ],
)
def test_settings_are_whole(tmp_path, settings, named):
    rows = [made_up_row(seed=s, settings=of_run) for s, of_run in enumerate(settings)]
    assert sorted(c.settings for c in cases_of(tmp_path, *rows)['biped']) == named


@pytest.mark.parametrize(
    ('columns', 'named'),
    [
        ({'terrain_set': 'seed-0'}, ['unseen-seed-0', 'unseen-seeds-1-12']),
        ({'n_c': '2', 'hidden': '12'}, ['', 'n_c2']),
        ({'hidden': '16x8'}, ['', 'hidden16x8']),
        ({'hidden': '0'}, ['', 'hidden0']),
        ({'substeps': '4'}, ['substeps1', 'substeps4']),
        ({'iterations': '20'}, ['iterations10', 'iterations20']),
        ({'self_collision': 'true'}, ['', 'self-collision']),
        ({'self_collision': 'other'}, ['', 'self-collision-other']),
        ({'code_version': '0.1.0', 'numpy_version': '3'}, ['']),
    ],
)
def test_columns_that_no_name_has_set_types_apart_too(tmp_path, columns, named):
    rows = [made_up_row(seed=0), {**made_up_row(seed=1), **columns}]
    assert sorted(c.settings for c in cases_of(tmp_path, *rows)['biped']) == named


def test_nothing_is_read_out_of_a_runs_name(tmp_path):
    rows = [{**made_up_row(seed=s), 'run': f'any-{s}-cma-uphill-20'} for s in range(3)]
    ((controller, runs),) = cases_of(tmp_path, *rows)['biped'].items()
    assert (controller, len(runs)) == (SNCA, 3)


def test_first_tables_are_read_beside_those_of_today(tmp_path):
    first = write_results(tmp_path / 'first', [
        first_row('biped', 'U-nD', 'snn-h', s) for s in range(3)
    ])
    today = write_results(tmp_path / 'today', paper_rows(3, ('biped',)))
    cases = read_cases([first])
    assert list(cases['biped']) == [SNCA]
    assert list(known_measures(cases)) == ['v_x_end', 'v_x_unseen', 'v_x_pushed_mean']
    assert 'robust' not in champions_table(cases).header[-2]
    (row,) = speeds_table(cases).rows
    assert [cell.split()[0] for cell in row[4:]] == ['6.00', '5.00', '4.00', '3.00', '2.50']

    joined = read_cases([first, today])
    types = [str(controller) for controller in joined['biped']]
    assert types == [
        'U-nD SNN-H, first-physics unseen-seed-0',
        'U-nD SNN-H, reference-physics unseen-seeds-1-12',
        'U-D MLP, reference-physics unseen-seeds-1-12',
        'nU-D MLP, reference-physics unseen-seeds-1-12',
    ]
    assert list(known_measures(joined)) == list(known_measures(cases))
    vibration = vibration_table(joined)
    assert vibration.rows[0][2] == '–'
    assert vibration.header[4] == 'above 50 % (or 4 Hz)'
    assert len(contrasts(joined)) == 3 * 6
    assert draw_all(joined, [])
