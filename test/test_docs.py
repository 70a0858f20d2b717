"""The documents: generated sections, pictures and links are what they should be."""

import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
from support.made_up_results import paper_rows, write_results

from docs import concept_pictures, study_figures
from docs.concept_pictures import DRAWINGS
from docs.declared_tables import NODES, TABLES
from docs.refresh import DOCS, SECTION, refreshed

COMMAND = '# Title\n\n<!-- $ snca {} -->\nold\n<!-- end -->\n\nThe rest.\n'


def test_sections_are_up_to_date(monkeypatch):
    monkeypatch.chdir(DOCS.parent)
    documents = [path for path in DOCS.glob('*.md') if SECTION.search(path.read_text())]
    assert {'graph.md', 'robustness.md', 'training.md'} < {path.name for path in documents}
    for path in documents:
        assert path.read_text() == refreshed(path.read_text()), f'make docs: {path.name} is old'


def test_a_section_holds_what_its_command_prints(tmp_path, capsys):
    text = COMMAND.format('--version')
    assert refreshed(text).splitlines()[4].startswith('snca_ros ')
    assert refreshed(refreshed(text)) == refreshed(text)
    assert capsys.readouterr().out == ''


def test_a_changed_table_or_text_is_noticed(tmp_path):
    folder = write_results(tmp_path / 'results', paper_rows(3, ('biped',)))
    text = refreshed(COMMAND.format(f'study {folder} --text'))
    assert '| biped | U-nD SNN-H | 3 | 30,000 |' in text
    assert text.endswith('<!-- end -->\n\nThe rest.\n')
    assert refreshed(text.replace('30,000', '31,000')) == text
    table = folder / 'results.csv'
    table.write_text(table.read_text().replace(',30000,', ',3000,'))
    assert refreshed(text) != text


def test_graph_has_a_section_for_each_node_and_every_parameter_topic_and_service():
    text = (DOCS / 'graph.md').read_text()
    assert re.findall(r'^<!-- table (\w+) -->$', text, re.MULTILINE) == [
        'topics', *(node.name for node in NODES)
    ]
    for node in NODES:
        section = text.partition(f'## {node.title}: `{node.name}`\n')[2]
        section = section.partition('<!-- end -->')[0]
        assert node.run in section
        names = re.findall(r'^\| `([^`]+)` \|', section, re.MULTILINE)
        rows = [name for group in node.parameters for name in group.fields]
        rows += [topic.of('<voxel>') if topic.of_voxel else topic.name
                 for topic in (*node.publishes, *node.subscribes)]
        assert names == [*rows, *(service.name for service in node.serves)]


@pytest.mark.parametrize(('table', 'old', 'new'), [
    ('sim_node', '| `duration` | 0 | s |', '| `duration` | 1 | s |'),
    ('sim_node', '| 0.1 to 3600 |', '| 0.2 to 3600 |'),
    ('voxel_node', 'sensor_msgs/msg/Image', 'sensor_msgs/msg/Text'),
    ('recorder_node', 'mcap, sqlite3', 'mcap'),
    ('view', '`markers`', '`marks`'),
    ('topics', 'mono8', 'mono9'),
    ('faults', '0 to 1000', '0 to 100'),
    ('evolve', '| `--population` | 36 |', '| `--population` | 37 |'),
])
def test_an_old_table_is_noticed(table, old, new):
    text = refreshed(f'<!-- table {table} -->\n<!-- end -->\n')
    assert text == f'<!-- table {table} -->\n\n{TABLES[table]()}\n<!-- end -->\n'
    assert old in text
    assert refreshed(text.replace(old, new)) == text != text.replace(old, new)


def test_cells_of_tables_hold_no_markup():
    for table in TABLES.values():
        rows = [line for line in table().splitlines() if line.startswith('|')]
        assert rows
        for row in rows:
            assert '<' not in re.sub(r'`[^`]*`', '', row)
    row = next(line for line in TABLES['faults']().splitlines() if '`broken_sensors`' in line)
    assert len(re.split(r'(?<!\\)\|', row)) == 7


def test_an_unknown_table_is_an_error():
    with pytest.raises(KeyError, match='sim_nod'):
        refreshed('<!-- table sim_nod -->\n<!-- end -->\n')


def test_a_command_that_fails_is_told(tmp_path, capsys):
    with pytest.raises(RuntimeError, match='nowhere --text: exit code 2'):
        refreshed(COMMAND.format(f'study {Path(tmp_path) / "nowhere"} --text'))
    capsys.readouterr()


def test_links_lead_somewhere_and_the_readme_lists_all_documents():
    for document in (*DOCS.glob('*.md'), *DOCS.parent.glob('*.md')):
        for link in re.findall(r'\]\(([^)]+)\)', document.read_text()):
            path, _, section = link.partition('#')
            if ':' in path:
                continue
            target = document.parent / path if path else document
            assert target.exists(), f'{document.name}: {link}'
            if section:
                heads = re.findall(r'^#+ (.+)$', target.read_text(), re.MULTILINE)
                anchors = [re.sub(r'[^\w -]', '', h).lower().replace(' ', '-') for h in heads]
                assert section in anchors, f'{document.name}: {link}'
    readme = (DOCS.parent / 'README.md').read_text()
    assert [path.name for path in DOCS.glob('*.md') if f'(docs/{path.name})' not in readme] == []


def test_concepts_explain_each_term_once_and_show_each_picture():
    text = (DOCS / 'concepts.md').read_text()
    terms = re.findall(r'\*\*(.+?)\*\*', text)
    assert len(terms) > 30
    assert len({term.lower() for term in terms}) == len(terms)
    assert re.findall(r'concepts/(\w+)\.svg', text) == list(DRAWINGS)


@pytest.mark.parametrize('name', DRAWINGS)
def test_pictures_of_concepts_are_drawn_from_the_model(name):
    kept = (concept_pictures.PICTURES / f'{name}.svg').read_text()
    drawn = concept_pictures.svg(name)
    assert texts(kept) == texts(drawn)
    assert len(list(ET.fromstring(drawn).iter())) > 20


def test_each_figure_of_a_campaign_is_shown_and_drawn_from_its_results():
    drawn = study_figures.figures()
    everything = ''.join(path.read_text() for path in DOCS.glob('*.md'))
    assert sorted(re.findall(r'figures/([\w/-]+)\.svg', everything)) == sorted(drawn)
    for name, svg in drawn.items():
        kept = (study_figures.FIGURES / f'{name}.svg').read_text()
        assert texts(kept) == texts(svg), f'make docs: {name}.svg is old'


def texts(svg: str) -> list[str]:
    """Return what stands written in a picture; how it is drawn depends on matplotlib."""
    return [e.text for e in ET.fromstring(svg).iter('{http://www.w3.org/2000/svg}text')]
