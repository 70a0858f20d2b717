"""docs/python.md and the notebook: every line of code, in its order, does what it says."""

import json
import os
import re
import subprocess
import sys

import pytest
from support.limits import LIMIT
from support.paths import ROOT
from support.synthetic_bag import Walk, messages_of_walk, write_messages

import snca_ros as snca
from sim_node.model.sensors import SENSORS
from snca_ros.cell.models import NEURON_MODELS
from snca_ros.command_line import CommandParser
from snca_ros.commands import COMMANDS, load_command
from snca_ros.evolution.tasks import TASKS

BUDGET = [  # what the test runs instead of what a person does
    ('episodes=3000', 'episodes=8, population=4, duration=1.0, transient=0.5'),
]
EXPECTED = re.compile(r'(.+?)\s+# -> (.+)')
"""A line that tells what its expression is."""


def blocks(page='python.md', budget=tuple(BUDGET)):
    text = (ROOT / 'docs' / page).read_text()
    found = re.findall(r'^```python\n(.*?)^```$', text, re.MULTILINE | re.DOTALL)
    assert text.count('```') == 2 * (len(found) + text.count('```sh'))
    for long, short in budget:
        assert any(long in block for block in found), long
        found = [block.replace(long, short) for block in found]
    return found


@pytest.fixture
def own_tasks():
    """Forget the tasks that the page registers."""
    before = set(TASKS)
    yield
    for name in set(TASKS) - before:
        del TASKS[name]


@pytest.mark.slow  # compiles a neuron model and a sensor
def test_every_line_of_the_page_runs(tmp_path, monkeypatch, capsys, own_tasks):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(NEURON_MODELS, '_entries', dict(NEURON_MODELS))
    walked = snca.load('biped-U-nD-snn-h').run(2.0, ('readings', 'actuation', 'spikes'))
    walk = Walk(
        walked.voxel_names, walked.centers, walked.readings[:-1], walked.actuation, walked.spikes
    )
    (tmp_path / 'bags').mkdir()
    write_messages(tmp_path / 'bags' / 'mine', messages_of_walk(walk))
    names, n_checked = {'__name__': 'page'}, 0
    monkeypatch.setattr(SENSORS, '_entries', dict(SENSORS._entries))
    for block in blocks():
        exec(compile(block, 'docs/python.md', 'exec'), names)
        for line in block.splitlines():
            if match := EXPECTED.fullmatch(line):
                assert str(eval(match[1], names)) == match[2], line
                n_checked += 1
            else:
                assert '->' not in line
    assert n_checked > 10
    assert (tmp_path / 'tripod.npz').exists()
    assert len(set(names['bobber'].history['median'])) == 3  # 3 generations, and scores differ
    assert capsys.readouterr().out.count('EvolutionRun(') == 3  # one per generation


def test_every_line_about_bodies_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    names, n_checked = {}, 0
    for block in blocks('bodies.md', [('starts=2', 'starts=2, duration=5.1')]):
        exec(compile(block, 'docs/bodies.md', 'exec'), names)
        for match in filter(None, map(EXPECTED.fullmatch, block.splitlines())):
            assert str(eval(match[1], names)) == match[2]
            n_checked += 1
    assert n_checked == 2
    assert snca.load('damaged.npz').trained.home.name == 'biped'


def test_the_shell_commands_of_the_page_are_commands():
    page = (ROOT / 'docs' / 'python.md').read_text()
    lines = re.findall(r'^(?:SNCA_PLUGINS=\w+ )?snca (.*)$', page, re.MULTILINE)
    inline = re.findall(r'`(?:SNCA_PLUGINS=\w+ )?snca ((?:evolve|walk) [^`]*)`', page)
    assert len(lines) == 2
    for command in (*lines, *inline):
        name, *words = command.split()
        module = load_command(name)
        CommandParser(name, COMMANDS[name], module).parse_args(words)


def test_the_part_below_the_guard_runs_too():
    (guarded,) = (block for block in blocks() if '__main__' in block)
    body = guarded.partition(':\n')[2].replace("'flat'", "'flat', duration=5.1")
    names = {'snca': snca, 'robot': snca.load('biped-U-D-mlp')}
    exec(body.strip(), names)


def test_the_page_names_every_public_name():
    text = (ROOT / 'docs' / 'python.md').read_text()
    types = {'EvolutionRun', 'Faults', 'Gait', 'RecordedEpisode', 'Recording', 'Robot', 'Scores'}
    for name in set(snca.__all__) - types:
        assert f'snca.{name}' in text, name


def cells():
    notebook = json.loads((ROOT / 'docs' / 'first_steps.ipynb').read_text())
    assert (notebook['nbformat'], notebook['nbformat_minor']) == (4, 5)
    identifiers = [cell['id'] for cell in notebook['cells']]
    assert len(set(identifiers)) == len(identifiers)
    return [cell for cell in notebook['cells'] if cell['cell_type'] == 'code']


def test_the_notebook_holds_no_outputs():
    for cell in cells():
        assert cell['outputs'] == []
        assert cell['execution_count'] is None


def test_the_notebook_runs(tmp_path):
    pytest.importorskip('matplotlib')
    sources = [''.join(cell['source']) for cell in cells()]
    program = tmp_path / 'cells.json'
    program.write_text(json.dumps(sources))
    runner = (
        'import json, pathlib; names = {"__name__": "__main__"}\n'
        'for source in json.loads(pathlib.Path("cells.json").read_text()):\n'
        '    exec(compile(source, "cell", "exec"), names)\n'
        'import matplotlib.pyplot as plt\n'
        'for number in plt.get_fignums():\n'
        '    plt.figure(number).savefig(f"{number}.png")\n'
    )
    environment = {**os.environ, 'PYTHONPATH': str(ROOT), 'MPLBACKEND': 'Agg'}
    found = subprocess.run(
        [sys.executable, '-W', 'error::UserWarning', '-c', runner], check=False, cwd=tmp_path,
        env=environment, capture_output=True, text=True, timeout=LIMIT,
    )
    assert found.returncode == 0, found.stderr
    assert re.search(r'^v_x \d+\.\d\d m/s, rhythm \d+\.\d\d Hz$', found.stdout, re.MULTILINE)
    assert len(list(tmp_path.glob('*.png'))) == 4
