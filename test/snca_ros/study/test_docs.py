"""The documents: their generated sections are what their commands print."""

from pathlib import Path

import pytest
from made_up_results import paper_rows, write_results

from docs.refresh import DOCS, refreshed

SECTION = '# Title\n\n<!-- $ snca {} -->\nold\n<!-- end -->\n\nThe rest.\n'


def test_sections_are_up_to_date(monkeypatch):
    monkeypatch.chdir(DOCS.parent)
    documents = [path for path in DOCS.glob('*.md') if '<!-- $' in path.read_text()]
    assert documents
    for path in documents:
        assert path.read_text() == refreshed(path.read_text()), f'make docs: {path.name} is old'


def test_a_section_holds_what_its_command_prints(tmp_path, capsys):
    text = SECTION.format('--version')
    assert refreshed(text).splitlines()[4].startswith('snca_ros ')
    assert refreshed(refreshed(text)) == refreshed(text)
    assert capsys.readouterr().out == ''


def test_a_changed_table_or_text_is_noticed(tmp_path):
    folder = write_results(tmp_path / 'results', paper_rows(3, ('biped',)))
    text = refreshed(SECTION.format(f'study {folder} --text'))
    assert '| biped | U-nD SNN-H | 3 | 30,000 |' in text
    assert text.endswith('<!-- end -->\n\nThe rest.\n')
    assert refreshed(text.replace('30,000', '31,000')) == text
    table = folder / 'results.csv'
    table.write_text(table.read_text().replace(',30000,', ',3000,'))
    assert refreshed(text) != text


def test_a_command_that_fails_is_told(tmp_path, capsys):
    with pytest.raises(RuntimeError, match='nowhere --text: exit code 2'):
        refreshed(SECTION.format(f'study {Path(tmp_path) / "nowhere"} --text'))
    capsys.readouterr()
