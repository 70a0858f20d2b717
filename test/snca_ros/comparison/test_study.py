"""The study command: joined tables, comparisons, warnings, figures and the page."""

import csv
import io
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from support.made_up_results import PAPER_TYPES, first_row, made_up_row, paper_rows, write_results

from sim_node.errors import InvalidInput
from snca_ros import cli
from snca_ros.campaign.results import read_curve
from snca_ros.comparison.figures import draw_all, median_curve
from snca_ros.comparison.pairwise import COLUMNS, contrasts, shown_contrasts
from snca_ros.comparison.rank_test import compare
from snca_ros.comparison.runs import (
    ControllerType,
    known_measures,
    missing_runs,
    read_cases,
    warnings,
)
from snca_ros.comparison.tables import (
    champions_table,
    factors_table,
    format_p,
    speeds_table,
    vibration_table,
)

SNCA = ControllerType('U-nD', 'snn-h')


def cases_of(tmp_path, *rows):
    return read_cases([write_results(tmp_path / 'results', list(rows))])


def study(*arguments, capsys):
    code = cli.main(['study', *map(str, arguments)])
    return code, *capsys.readouterr()


@pytest.fixture(scope='module')
def drawn(tmp_path_factory):
    """Return the output folder of a study of 3 shapes × 3 types × 4 seeds."""
    folder = tmp_path_factory.mktemp('drawn')
    results = write_results(folder / 'results', paper_rows(4))
    assert cli.main(['study', str(results)]) == 0
    return results / 'study'


# --- tables joined ----------------------------------------------------------------------------


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
    with pytest.raises(InvalidInput, match=r'two/results.csv: run: .*one/results.csv has'):
        read_cases([one, two])


# --- what is missing or may mislead -----------------------------------------------------------


def test_equal_seeds_and_budgets_give_no_warning(tmp_path):
    cases = cases_of(tmp_path, *paper_rows(3))
    assert warnings(cases) == []
    assert missing_runs(cases, []) == []


@pytest.mark.parametrize(
    ('more', 'words'),
    [
        (made_up_row(neuron_model='snn'), 'U-nD SNN: 1 seed, too few'),
        (made_up_row(seed=3, evaluations=500), 'unequal budgets'),
        (made_up_row(seed=3, v_x_unseen=-np.inf), 'U-nD SNN-H: 1 of 4 runs diverged'),
    ],
)
def test_what_may_mislead_is_told(tmp_path, more, words):
    (line,) = warnings(cases_of(tmp_path, *paper_rows(3, ('biped',)), more))
    assert line.startswith('biped')
    assert words in line


def test_unequal_budgets_are_told_with_their_numbers(tmp_path):
    rows = [made_up_row(seed=s) for s in range(3)]
    rows += [made_up_row('biped', 'U-D', 'mlp', s, evaluations=500 + 36 * s) for s in range(3)]
    assert warnings(cases_of(tmp_path, *rows)) == [
        'biped: unequal budgets: 3 seeds × 30,000 evaluations of U-nD SNN-H; '
        '3 seeds × 500 to 572 evaluations of U-D MLP'
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
        'architecture': ['U-D', 'nU-D'],
    }))
    assert missing_runs(cases, [file]) == [
        'biped: only 2 of 3 runs of U-D MLP, nU-D MLP', 'comb: no run yet of U-D MLP, nU-D MLP'
    ]


# --- comparisons ------------------------------------------------------------------------------


def test_every_pair_is_compared_on_each_shape_and_corrected_in_its_family(tmp_path):
    cases = cases_of(tmp_path, *paper_rows(6))
    found = contrasts(cases)
    assert len(found) == 3 * 4 * 3
    family = [c for c in found if (c.shape, c.measure) == ('comb', 'v_x_unseen')]
    assert [(str(c.first), str(c.second)) for c in family] == [
        ('U-nD SNN-H', 'U-D MLP'), ('U-nD SNN-H', 'nU-D MLP'), ('U-D MLP', 'nU-D MLP')
    ]
    p = sorted((c.result.p, c.p_holm) for c in family)
    assert p[0][1] == min(1.0, 3.0 * p[0][0])
    assert p[1][1] == max(p[0][1], min(1.0, 2.0 * p[1][0]))
    assert p[2][1] == max(p[1][1], p[2][0])
    numbers = [
        np.array([float(run.row['v_x_unseen']) for run in cases['comb'][of_type]])
        for of_type in (family[0].first, family[0].second)
    ]
    assert family[0].result == compare(*numbers)
    assert family[0].medians == tuple(np.median(numbers, axis=1))


def test_of_many_types_the_first_is_shown_with_each(tmp_path):
    rows = [
        made_up_row('comb', a, m) for a in ('U-nD', 'U-D') for m in ('mlp', 'snn', 'snn-h')
    ]
    found = contrasts(cases_of(tmp_path, *rows, *paper_rows(1, ('biped',))))
    shown = shown_contrasts(found)
    assert sum(c.shape == 'comb' for c in found) == 4 * 15
    assert sum(c.shape == 'comb' for c in shown) == 4 * 5
    assert {c.first for c in shown if c.shape == 'comb'} == {SNCA}
    assert [c for c in shown if c.shape == 'biped'] == [c for c in found if c.shape == 'biped']


def test_statistics_csv_has_every_contrast(drawn):
    with (drawn / 'statistics.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    found = contrasts(read_cases([drawn.parent]))
    assert tuple(rows[0]) == COLUMNS
    assert len(rows) == len(found)
    for row, contrast in zip(rows, found, strict=True):
        assert (row['shape'], row['measure']) == (contrast.shape, contrast.measure)
        assert (row['first'], row['n_second']) == (str(contrast.first), '4')
        assert float(row['p']) == contrast.result.p
        assert float(row['p_holm']) == contrast.p_holm
        assert float(row['a_low']) == contrast.result.a_low
        assert float(row['median_second']) == contrast.medians[1]


# --- curves -----------------------------------------------------------------------------------


def test_curve_is_read_and_damage_told(tmp_path):
    path = tmp_path / 'run.csv'
    path.write_text('evaluations,best_so_far\n36,-inf\n71,0.5\n106,0.5\n')
    assert read_curve(path).tolist() == [[36.0, -np.inf], [71.0, 0.5], [106.0, 0.5]]
    for text in (
        '', 'evaluations,best\n1,2\n', 'evaluations,best_so_far\n', '\0',
        'evaluations,best_so_far\n36,1\n71\n', 'evaluations,best_so_far\n36,1,2\n',
        'evaluations,best_so_far\n36,x\n', 'evaluations,best_so_far\n36,1\n71,0.5\n',
        'evaluations,best_so_far\n71,1\n36,1\n', 'evaluations,best_so_far\n36,nan\n',
    ):
        path.write_text(text)
        with pytest.raises(InvalidInput, match=r'run\.csv: file'):
            read_curve(path)
    with pytest.raises(InvalidInput, match='No such file'):
        read_curve(tmp_path / 'none.csv')


def test_median_curve_worked_by_hand():
    one = np.array([[2.0, 1.0], [6.0, 5.0]])
    two = np.array([[1.0, 0.0], [4.0, 3.0], [8.0, 9.0]])
    evaluations, (low, median, high) = median_curve([one, two])
    assert evaluations.tolist() == [2.0, 4.0, 6.0]  # where both have been and neither has ended
    assert median.tolist() == [0.5, 2.0, 4.0]
    assert low.tolist() == [0.25, 1.5, 3.5]
    assert high.tolist() == [0.75, 2.5, 4.5]


@given(st.lists(st.lists(st.tuples(st.integers(1, 99), st.floats(0, 9)), min_size=1), min_size=1))
def test_median_curve_never_falls(runs):
    curves = [
        np.array([sorted(n for n, _ in run), sorted(v for _, v in run)], float).T for run in runs
    ]
    evaluations, found = median_curve(curves)
    assert found.shape == (3, len(evaluations))
    assert (np.diff(found, axis=1) >= -1e-12).all()
    assert (np.diff(found, axis=0) >= -1e-12).all()


# --- page and figures -------------------------------------------------------------------------


def test_figures_are_files_and_tell_what_the_table_says(drawn):
    names = {path.stem for path in drawn.glob('*.svg')}
    kinds = ('boxes', 'medians', 'curves', 'vibration', 'luck')
    assert names == {f'{kind}-{shape}' for kind in kinds for shape in ('biped', 'comb', 'worm')}
    rows = [row for row in paper_rows(4, ('worm',)) if row['architecture'] == 'U-D']
    medians = ''.join(ET.parse(drawn / 'medians-worm.svg').getroot().itertext())
    for column in ('v_x_end', 'v_x_unseen', 'v_x_pushed_mean', 'v_x_robust_mean'):
        assert f'{np.median([float(row[column]) for row in rows]):.1f}' in medians
    boxes = ''.join(ET.parse(drawn / 'boxes-worm.svg').getroot().itertext())
    shown = [
        c for c in contrasts(read_cases([drawn.parent]))
        if c.shape == 'worm' and c.measure in ('v_x_end', 'v_x_unseen')
    ]
    assert len(re.findall(r'\d\.\d{3} \(', boxes)) == len(shown) == 6
    assert all(f'{c.result.p:.3f} ({c.p_holm:.3f})' in boxes for c in shown)
    assert boxes.count('n = 4') == 3


def test_page_is_whole_and_self_contained(drawn):
    page = (drawn / 'index.html').read_text()
    tree = ET.fromstring(page.partition('\n')[2].replace('<meta charset="utf-8">', '').replace(
        '<meta name="viewport" content="width=device-width, initial-scale=1">', ''
    ))
    assert not re.search(r'<(script|link|img|iframe)\b|url\((?!#)|@import', page)
    assert re.findall(r'(?:href|src)="(?!#)', page) == []
    ids = re.findall(r' id="([^"]+)"', page)
    assert len(ids) == len(set(ids))
    assert {name for name in re.findall(r'(?:href="|url\()#([^")]+)', page)} <= set(ids)
    captions = [''.join(c.itertext()) for c in tree.iter('figcaption')]
    assert len(captions) == 15
    told = '4 seeds × 30,000 evaluations of U-nD SNN-H, U-D MLP, nU-D MLP'
    assert all(caption.endswith(told) for caption in captions)
    assert [len(list(table.iter('tr'))) for table in tree.iter('table')] == [
        1 + 9, 1 + 9, 1 + 9, 1 + 1, 1 + 36,
    ]
    assert '#1a1a1a' not in page
    assert 'Warnings' not in page


def test_page_and_command_tell_warnings_and_what_is_missing(tmp_path, capsys):
    rows = [made_up_row(seed=0), made_up_row('worm', 'U-D', 'mlp', v_x_pushed_mean=-np.inf,
                                             v_x_pushed_std=np.nan, v_x_end=-np.inf)]
    results = write_results(tmp_path / 'results', rows)
    code, out, _ = study(results, '--output', tmp_path / 'out', capsys=capsys)
    assert code == 0
    page = (tmp_path / 'out' / 'index.html').read_text()
    for line in ('biped, U-nD SNN-H: 1 seed, too few for a conclusion',
                 'biped: no run yet of U-D MLP', 'worm, U-D MLP: 1 of 1 runs diverged'):
        assert line in page
        assert line in out
    assert not (results / 'study').exists()


def test_the_same_tables_give_the_same_bytes(drawn, tmp_path):
    assert cli.main(['study', str(drawn.parent), '--output', str(tmp_path)]) == 0
    assert {p.name: p.read_bytes() for p in tmp_path.iterdir()} == {
        p.name: p.read_bytes() for p in drawn.iterdir()
    }


def test_text_is_the_summary_and_writes_nothing(tmp_path, capsys):
    rows = [
        made_up_row('biped', *of_type, seed, v_x_end=v_x + seed, v_x_other=0.5)
        for of_type, v_x in zip(PAPER_TYPES, (5.0, 1.0, 0.0), strict=True) for seed in range(3)
    ]
    results = write_results(tmp_path / 'results', rows)
    (results / 'results.csv').chmod(0o444)
    before = sorted(results.rglob('*'))
    code, out, err = study(results, '--text', capsys=capsys)
    assert (code, err) == (0, '')
    assert '| biped | U-nD SNN-H | 3 | 30,000 | 6.00 (5.50 to 6.50) | 0.50 (0.50 to 0.50) |' in out
    # 3 against 3 that do not overlap: p = 2/20, times 3, 3 and (with the ties) again no less.
    assert '| biped | end of evolution | U-nD SNN-H | U-D MLP | 6.00, 2.00 | 0.100 | 0.300 |' in out
    assert sorted(results.rglob('*')) == before
    tables = [line for line in out.splitlines() if line.startswith('|')]
    assert len(tables) == 2 + 3 + 2 + 3 + 2 + 3 + 2 + 1 + 2 + 12
    fastest = '| biped-U-nD-snn-h-flat-batched-reference-seed'
    assert sum(line.startswith(fastest) for line in tables) == 1


def test_the_fastest_of_a_type_is_so_over_pushed_starts(tmp_path):
    rows = [
        made_up_row(seed=s, v_x_end=v_x, v_x_pushed_mean=mean, v_x_pushed_std=0.25)
        for s, (v_x, mean) in enumerate([(9.0, 1.0), (5.0, 4.0), (7.0, 3.0)])
    ]
    (row,) = champions_table(cases_of(tmp_path, *rows)).rows
    assert row[:2] == ['biped-U-nD-snn-h-flat-batched-reference-seed1', '5.00']
    assert row[4:6] == ['4.00 ± 0.25', '1 to 20']
    assert row[7] == '101 to 120'


def test_architectures_and_neuron_models_are_compared_where_all_else_is_alike(tmp_path):
    speeds = {
        ('U-nD', 'snn-h'): 5.0, ('U-nD', 'mlp'): 2.0, ('U-D', 'snn-h'): 4.0, ('U-D', 'mlp'): 3.0,
    }
    rows = [
        made_up_row(shape, *of_type, seed, v_x_end=v_x + seed, v_x_unseen=-v_x,
                    v_x_pushed_mean=1.0, v_x_robust_mean=v_x)
        for shape in ('biped', 'comb') for of_type, v_x in speeds.items() for seed in range(3)
    ]
    rows.append(made_up_row('worm', 'nU-D', 'snn', v_x_end=9.0))  # has nothing to be compared with
    table = factors_table(cases_of(tmp_path, *rows))
    measures = ['end of evolution', 'unseen terrains', 'pushed mean', 'robust']
    assert table.header == ['first', 'second', 'with', 'shapes', *measures]
    assert table.rows == [
        ['SNN-H', 'MLP', 'U-D', '2', '2', '0', '0', '2'],
        ['SNN-H', 'MLP', 'U-nD', '2', '2', '0', '0', '2'],
        ['U-nD', 'U-D', 'MLP', '2', '0', '2', '0', '0'],
        ['U-nD', 'U-D', 'SNN-H', '2', '2', '0', '0', '2'],
    ]
    assert factors_table(cases_of(tmp_path / 'one', rows[0])).rows == []


def test_types_with_settings_are_compared_with_their_like(tmp_path):
    rows = [
        made_up_row('biped', architecture, 'snn', settings={'terrain': terrain})
        for terrain in ('flat', 'uphill-10') for architecture in ('U-D', 'nU-D')
    ]
    assert [row[:4] for row in factors_table(cases_of(tmp_path, *rows)).rows] == [
        ['U-D', 'nU-D', 'SNN, flat', '1'], ['U-D', 'nU-D', 'SNN, uphill-10', '1'],
    ]


def test_robots_that_all_diverged_can_be_drawn(tmp_path):
    names = 'v_x_end', 'v_x_other', 'v_x_unseen', 'v_x_pushed_mean', 'v_x_robust_mean'
    speeds = dict.fromkeys(names, -np.inf)
    assert len(draw_all(cases_of(tmp_path, made_up_row(**speeds)), [])) == 5


def test_tables_without_rows_are_left_out(tmp_path, capsys):
    code, out, _ = study(write_results(tmp_path / 'one', [made_up_row()]), '--text', capsys=capsys)
    assert (code, sum(line.startswith('| ---') for line in out.splitlines())) == (0, 3)
    assert '**First type' not in out


def test_vibrating_runs_are_counted_and_compared_with_the_others(tmp_path):
    numbers = [(0.5, 1.0, 8.0), (0.51, 2.0, 8.0), (0.9, 4.0, 4.0), (1.0, -1.0, 0.49)]
    rows = [
        made_up_row(
            seed=s, vibration=share, frequency=1.0 + s, v_x_unseen=unseen, v_x_pushed_mean=v_x
        )
        for s, (share, unseen, v_x) in enumerate(numbers)
    ]
    rows.append(
        made_up_row('comb', vibration=0.0, frequency=9.0, v_x_pushed_mean=2.0, v_x_unseen=-np.inf)
    )
    table = vibration_table(cases_of(tmp_path, *rows))
    assert table.header[2:6] == [
        'power above 8 Hz [%]', 'peak [Hz]', 'above 50 %',
        'pushed mean [m/s] and share kept of those',
    ]
    assert table.rows == [
        ['biped', str(SNCA), '50 to 100', '1.00 to 4.00', '3 of 4', '6.00, 62 %', '8.00, 12 %'],
        ['comb', str(SNCA), '0 to 0', '9.00 to 9.00', '0 of 1', '–', '2.00, -inf %'],
    ]


def test_of_the_first_tables_the_peak_alone_tells_who_vibrates(tmp_path):
    rows = [
        first_row('biped', 'U-nD', 'snn-h', s, frequency=f, v_x_unseen=unseen, v_x_batched=v_x)
        for s, (f, unseen, v_x) in enumerate([(4.0, 1.0, 8.0), (4.1, 2.0, 8.0), (15.0, 4.0, 4.0)])
    ]
    table = vibration_table(cases_of(tmp_path, *rows))
    assert table.header[2:4] == ['frequency [Hz]', 'above 4 Hz']
    assert table.rows == [
        ['biped', str(SNCA), '4.00 to 15.00', '2 of 3', '6.00, 62 %', '8.00, 12 %']
    ]
    kinds = [kind for kind, *_ in draw_all(cases_of(tmp_path / 'drawn', *rows), [])]
    assert kinds == ['boxes', 'medians', 'curves', 'frequency', 'luck']


@pytest.mark.parametrize(
    ('p', 'told'),
    [(0.0009, '< 0.001'), (0.001, '0.001'), (0.0503, '0.0503'), (0.0496, '0.0496'), (0.3, '0.300')],
)
def test_a_p_value_tells_its_side_of_the_level(p, told):
    assert format_p(p) == told


@pytest.mark.parametrize(
    ('settings', 'told'),
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
def test_settings_are_told_whole(tmp_path, settings, told):
    rows = [made_up_row(seed=s, settings=of_run) for s, of_run in enumerate(settings)]
    assert sorted(c.settings for c in cases_of(tmp_path, *rows)['biped']) == told


@pytest.mark.parametrize(
    ('columns', 'told'),
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
def test_columns_that_no_name_has_set_types_apart_too(tmp_path, columns, told):
    rows = [made_up_row(seed=0), {**made_up_row(seed=1), **columns}]
    assert sorted(c.settings for c in cases_of(tmp_path, *rows)['biped']) == told


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


def test_a_run_that_one_engine_cannot_do_has_no_speed_there(tmp_path):
    cases = cases_of(tmp_path, *(made_up_row(seed=s, v_x_other='') for s in range(3)))
    (row,) = speeds_table(cases).rows
    assert row[5] == '–'
    assert champions_table(cases).rows[0][2] == '–'
    assert draw_all(cases, [])


def test_types_with_settings_have_rows_of_their_own_in_the_table_of_medians(tmp_path):
    settings = {}, {'terrain': 'uphill-10'}, {'strategy': 'cma'}
    rows = [made_up_row(settings=of_run, v_x_unseen=9.9) for of_run in settings]
    rows.append(made_up_row(as_printed=True, v_x_unseen=8.8))
    drawn = {kind: svg for kind, _, svg in draw_all(cases_of(tmp_path, *rows), [])}
    texts = [e.text for e in ET.fromstring(drawn['medians']).iter() if e.text]
    assert texts.count('9.9') == 3
    assert texts.count('8.8') == 1
    assert {'U-nD, uphill-10 es', 'U-nD, flat es', 'U-nD, flat cma'} <= set(texts)


@pytest.mark.parametrize(
    ('row', 'words'),
    [
        (None, ['at least one finished run']),
        ({'architecture': 'X-D'}, ['results.csv: architecture', "'X-D'", 'nU-nD']),
        ({'chosen_by': 'dice'}, ['results.csv: chosen_by', "'dice'", 'batched']),
        ({'v_x_unseen': 'nan'}, ['results.csv: v_x_unseen', "'nan'"]),
        ({'v_x_robust_mean': 'nan'}, ['results.csv: v_x_robust_mean', "'nan'"]),
        ({'strategy': 'esx'}, ['results.csv: strategy', "'esx'", "did you mean 'es'?"]),
        ({'physics': 'second'}, ['results.csv: physics', "'second'"]),
        ({'terrain_set': 'seeds-1-13'}, ['results.csv: terrain_set', "'seeds-1-12'"]),
        ({'n_c': '0'}, ['results.csv: n_c', '0']),
        ({'as_printed': 'maybe'}, ['results.csv: as_printed', "'maybe'"]),
    ],
)
def test_bad_tables_are_told_in_one_line(tmp_path, capsys, row, words):
    rows = [] if row is None else [{**made_up_row(), **row}]
    results = write_results(tmp_path / 'results', rows)
    code, out, err = study(results, capsys=capsys)
    assert (code, out, err.count('\n')) == (2, '', 1)
    assert all(word in err for word in words)
    assert not (results / 'study').exists()


def test_bad_places_are_told_in_one_line(tmp_path, capsys):
    results = write_results(tmp_path / 'results', [made_up_row()])
    (tmp_path / 'file').write_text('')
    for arguments in (
        [tmp_path / 'nowhere'], [results, '--output', tmp_path / 'file'],
        [results, '--campaign', tmp_path / 'no.yaml'],
    ):
        code, _, err = study(*arguments, capsys=capsys)
        assert (code, err.count('\n')) == (2, 1)
        assert 'expected' in err
    (results / 'histories' / f'{made_up_row()["run"]}.csv').unlink()
    code, _, err = study(results, capsys=capsys)
    assert code == 2
    assert 'the history of a run' in err
    assert not (results / 'study').exists()
    with pytest.raises(SystemExit):
        study(results, '--text', '--output', tmp_path / 'out', capsys=capsys)


def test_made_up_table_is_what_the_csv_module_reads(drawn):
    """The fixture itself: rows survive the file."""
    text = (drawn.parent / 'results.csv').read_text()
    assert list(csv.DictReader(io.StringIO(text))) == paper_rows(4)
