"""The `report` command: its output, figure and JSON, and invalid input."""

import json

import numpy as np
import pytest
from PIL import Image
from support.synthetic_bag import (
    Walk,
    death,
    diagnostics,
    make_walk,
    messages_of_walk,
    write_messages,
)

from snca_ros.cli import main
from snca_ros.command_line import BAD_INPUT
from snca_ros.recording.bag import read_bag
from snca_ros.recording.figures import draw_recording
from snca_ros.recording.gait import measure_gait

N_STEPS = 30


@pytest.fixture
def bag(tmp_path):
    """A bag of a short walk of two voxels from which two messages are missing."""
    messages = messages_of_walk(make_walk(N_STEPS))
    for k in (7, 8):
        messages[k] = [m for m in messages[k] if m[0] != '/biped/voxel_1_0/spikes']
    return write_messages(tmp_path / 'bag', messages)


def test_printed_report(bag, capsys):
    assert main(['report', str(bag)]) == 0
    out = capsys.readouterr().out
    gait = measure_gait(read_bag(bag))
    words = [line.split() for line in out.splitlines()]
    assert ['v_x', repr(gait.velocity), 'm/s', '(whole', 'walk)'] in words
    assert ['physics', 'reference'] in words
    rate, peak = f'{gait.firing_rates[0]:.1f}', f'{gait.frequencies[0]:.2f}'
    assert ['voxel_0_0', rate, peak, '0', '0'] in words
    assert ['messages', 'sent', 'in', 'time', 'late', 'lost', 'never', 'sent'] in words
    assert ['spikes', '60', '58', '0', '2', '0'] in words
    assert ['sensors', '60', '60', '0', '0', '0'] in words
    assert ['odometry', '31', '31', '0', '0', '0'] in words
    assert ['total', '242', '240', '0', '2', '0'] in words
    assert 'lost on /biped/voxel_1_0/spikes: 2 (steps 7, 8)' in out
    assert '/biped/markers 16' in out
    with Image.open(bag / 'report.png') as picture:
        assert min(picture.size) > 400


def test_a_bag_that_cannot_be_written_is_reported(bag, tmp_path, capsys):
    (bag / 'report.png').mkdir()  # like a read-only bag, also for root
    assert main(['report', str(bag), '--json', '-']) == 0
    out, err = capsys.readouterr()
    assert json.loads(out)['robot'] == 'biped'
    assert 'no figure, the bag cannot be written; name a file by --figure (' in err
    assert main(['report', str(bag), '--figure', str(tmp_path / 'figure.png')]) == 0
    assert capsys.readouterr().out.endswith(f'figure: {tmp_path / "figure.png"}\n')
    (bag / 'replay.html').mkdir()
    assert main(['report', str(bag), '--html']) == BAD_INPUT
    assert 'page: got ' in capsys.readouterr().err


def test_deliveries_and_step_times(tmp_path, capsys):
    messages = messages_of_walk(make_walk(N_STEPS))
    of_simulation = {
        'step time p50 [ms]': 16.67, 'step time p99 [ms]': 18.0, 'step time max [ms]': 40.5,
        'missed deadlines': 2, 'voxel_0_0/actuation on time': 20,
        'voxel_0_0/actuation late': 3, 'voxel_0_0/actuation lost': 7,
    }
    messages[-1] += [
        ('/diagnostics', diagnostics('/biped/sim_node', {'steps': 30, **of_simulation})),
        ('/diagnostics', diagnostics('/biped/voxel_0_0', {
            'voxel_1_0/spikes on time': 29, 'voxel_1_0/spikes late': 0, 'voxel_1_0/spikes lost': 0,
        })),
    ]
    bag = write_messages(tmp_path / 'bag', messages)
    assert main(['report', str(bag), '--json', str(tmp_path / 'r.json')]) == 0
    out = capsys.readouterr().out
    assert 'step time  16.67 ms p50, 18.00 ms p99, 40.50 ms max; 2 missed deadlines' in out
    words = [line.split() for line in out.splitlines()]
    assert ['at', 'the', 'nodes', 'on', 'time', 'late', 'lost'] in words
    assert ['actuation', '20', '3', '7'] in words
    assert ['spikes', '29', '0', '0'] in words
    assert 'voxel_0_0/actuation at sim_node: 3 late, 7 lost' in out
    assert 'voxel_1_0/spikes at' not in out
    written = json.loads((tmp_path / 'r.json').read_text())['nodes']['sim_node']
    assert written['links'] == {'voxel_0_0/actuation': {'on time': 20, 'late': 3, 'lost': 7}}
    assert written['figures']['missed deadlines'] == 2


def test_a_death_is_reported(tmp_path, capsys):
    """A voxel answers until step 4, again from step 20, and late what it missed since 10."""
    bag = write_messages(tmp_path / 'bag', death(N_STEPS, 1, dead=5, backlog=10, alive=20))
    assert main(['report', str(bag), '--json', str(tmp_path / 'r.json')]) == 0
    out = capsys.readouterr().out
    words = [line.split() for line in out.splitlines()]
    for kind in ('actuation', 'spikes'):
        assert [kind, '55', '45', '10', '0', '5'] in words
        assert f'late on /biped/voxel_1_0/{kind}: 10 (steps 10, 11, 12, 13, 14, ...)' in out
        assert f'never sent on /biped/voxel_1_0/{kind}: 5 (steps 5, 6, 7, 8, 9)' in out
    assert [line[-2:] for line in words if line[:1] == ['voxel_1_0']] == [['2', '13']]
    written = json.loads((tmp_path / 'r.json').read_text())
    assert written['voxels']['voxel_1_0']['steps'] == {
        'in time': 15, 'held': 2, 'limp': 13, 'unknown': 0
    }
    counts = written['topics']['/biped/voxel_1_0/spikes']
    assert (counts['in_time'], counts['late'], counts['never_sent']) == (15, 10, 5)
    figure = draw_recording(read_bag(bag))
    assert any('limp' in axes.get_title(loc='left') for axes in figure.axes)


def test_json_and_figure_are_written_to_given_paths(bag, tmp_path):
    figure, numbers = tmp_path / 'walk.svg', tmp_path / 'walk.json'
    assert main(['report', str(bag), '--figure', str(figure), '--json', str(numbers)]) == 0
    assert b'<svg' in figure.read_bytes()
    written = json.loads(numbers.read_text())
    gait = measure_gait(read_bag(bag))
    assert written['v_x'] == gait.velocity
    assert written['physics'] == 'reference'
    assert written['voxels']['voxel_1_0']['frequency'] == gait.frequencies[1]
    assert written['topics']['/biped/voxel_1_0/spikes'] == {
        'sent': 30, 'received': 28, 'in_time': 28, 'late': 0, 'lost': 2, 'never_sent': 0,
        'refused': 0, 'lost_by_kill': 0, 'not_recorded': 0, 'published_twice': 0,
    }
    assert written['topics']['/biped/markers'] == {
        'sent': None, 'received': 16, 'in_time': None, 'late': None, 'lost': None,
        'never_sent': None, 'refused': 0, 'lost_by_kill': None, 'not_recorded': None,
        'published_twice': None,
    }
    assert not (bag / 'report.png').exists()


def test_an_unclosed_bag_and_resets_are_reported(tmp_path, capsys):
    walk = messages_of_walk(make_walk(5))
    bag = write_messages(tmp_path / 'bag', [*walk, *walk[:3]], killed=True)
    assert main(['report', str(bag)]) == 0
    out = capsys.readouterr().out
    assert 'did not close' in out
    assert 'episode 1 of 0 to 1' in out
    assert main(['report', str(bag), '--episode', '0']) == 0
    assert 'episode 0 of 0 to 1' in capsys.readouterr().out


@pytest.mark.parametrize('kind', ['values', 'nothing'])
def test_cells_without_spikes(tmp_path, capsys, kind):
    walk = make_walk(N_STEPS)
    values = np.random.default_rng(0).uniform(-1, 1, (N_STEPS, 2, 1))
    walk = Walk(
        walk.voxels, walk.centers, walk.readings, walk.actuation,
        values=values if kind == 'values' else None,
    )
    bag = write_messages(tmp_path / 'bag', messages_of_walk(walk))
    assert main(['report', str(bag)]) == 0
    words = [line.split() for line in capsys.readouterr().out.splitlines()]
    assert any(line[:2] == ['voxel_0_0', '-'] for line in words)


def test_a_bag_of_one_step(tmp_path, capsys):
    bag = write_messages(tmp_path / 'bag', messages_of_walk(make_walk(3))[:1])
    assert main(['report', str(bag), '--json', str(tmp_path / 'r.json')]) == 0
    assert 'v_x        0.0 m/s' in capsys.readouterr().out
    assert json.loads((tmp_path / 'r.json').read_text())['steps_per_second'] is None


def test_the_panels_have_names_and_units(bag):
    trajectory, areas, messages, *_ = draw_recording(read_bag(bag)).axes
    assert '[m]' in trajectory.get_xlabel()
    assert '[m]' in trajectory.get_ylabel()
    assert '[s]' in messages.get_xlabel()
    assert areas.get_xlim() == messages.get_xlim()
    labels = [label.get_text() for label in messages.get_yticklabels()]
    assert labels == ['voxel_0_0', 'voxel_1_0']


def test_bad_input_is_reported_in_one_line(bag, tmp_path, capsys):
    cases = (
        [str(tmp_path / 'nowhere')],
        [str(bag), '--figure', str(tmp_path / 'nowhere' / 'a.png')],
        [str(bag), '--figure', str(tmp_path / 'a.doc')],
        [str(bag), '--figure', str(tmp_path / 'no suffix')],
        [str(bag), '--json', str(tmp_path / 'nowhere' / 'a.json')],
        [str(bag), '--episode', '3'],
    )
    for case in cases:
        assert main(['report', *case]) == BAD_INPUT
        err = capsys.readouterr().err
        assert err.startswith('snca report: error: ')
        assert 'expected' in err
        assert err.count('\n') == 1
    assert sorted(p.name for p in tmp_path.iterdir()) == ['bag']
