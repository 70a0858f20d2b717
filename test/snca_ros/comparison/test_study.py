"""The study command: its page, its text, and what it refuses in one line."""

import csv
import io
import re
import xml.etree.ElementTree as ET

import numpy as np
import pytest
from support.comparison import study
from support.made_up_results import PAPER_TYPES, made_up_row, paper_rows, write_results

from snca_ros import cli


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
    ending = '4 seeds × 30,000 episodes of U-nD SNN-H, U-D MLP, nU-D MLP'
    assert all(caption.endswith(ending) for caption in captions)
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


def test_tables_without_rows_are_left_out(tmp_path, capsys):
    code, out, _ = study(write_results(tmp_path / 'one', [made_up_row()]), '--text', capsys=capsys)
    assert (code, sum(line.startswith('| ---') for line in out.splitlines())) == (0, 3)
    assert '**First type' not in out


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
