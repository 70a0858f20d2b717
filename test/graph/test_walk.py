"""The `walk` command: starts, supervises and ends the whole graph, and leaves no process."""

import json
import os
import signal
import sys

import numpy as np
import pytest
from support.limits import LIMIT
from support.processes import is_alive, nodes_of, offspring, wait_until

from sim_node.model.solver import Solver
from snca_ros.cli import main
from snca_ros.controller_file import load_controller
from snca_ros.faults import parse_faults
from snca_ros.recording.bag import read_bag
from snca_ros.recording.offline import record_offline


@pytest.mark.parametrize(('seconds', 'n', 'physics', 'faults'), [
    (4.15, 250, 'reference', ''),  # 4.15 * 60 > 249 in floating point
    (1.5, 91, 'first', 'loss=0.5,death=0.7@0.5-1,broken_actuators=random:0.4@1'),
])
def test_walk_equals_its_offline_twin(
    start, make_controller, tmp_path, seconds, n, physics, faults
):
    path = make_controller('11-10', solver=Solver(physics=physics))
    child = start('walk', path, '--duration', seconds, '--bag', 'bag', '--faults', faults,
                  real=True)
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0, output
    assert f'{n} positions of the centre, bit for bit the same' in output
    assert 'Traceback' not in output
    assert f'physics    {physics}\n' in output
    assert 'was evolved in' not in output
    assert {'metadata.yaml', 'bag.mcap', 'report.png'} <= {
        p.name for p in (tmp_path / 'bag').iterdir()
    }
    trained = load_controller(tmp_path / '11-10-U-nD-snn-h-0.npz')
    twin, _ = record_offline(trained, tmp_path, seconds, faults=parse_faults(faults))
    poses = read_bag(tmp_path / 'bag').poses
    np.testing.assert_array_equal(poses.corners, twin.poses.corners[poses.steps])
    np.testing.assert_array_equal(poses.ground, twin.poses.ground)


@pytest.mark.parametrize(('architecture', 'options', 'grid', 'missing'), [
    ('U-nD', {'shape': '1111-1111-1001', 'without': 'voxel_0_0,voxel_0_1,voxel_0_2'},
     'x111-x111-x001', ['voxel_0_0', 'voxel_0_1', 'voxel_0_2']),
    ('nU-D', {'without': 'voxel_1_1'}, '1x-10', ['voxel_1_1']),
])
def test_walk_in_another_body_equals_its_offline_twin(
    start, make_controller, tmp_path, capsys, architecture, options, grid, missing
):
    path = make_controller('11-10', architecture)
    words = [word for name, value in options.items() for word in (f'--{name}', value)]
    child = start('walk', path, '--duration', 1.5, '--bag', 'bag', '--json', 'walk.json',
                  '--voxels-per-process', 3, *words)
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0, output
    assert '91 positions of the centre, bit for bit the same' in output
    report = json.loads((tmp_path / 'walk.json').read_text())
    assert (report['body'], report['missing']) == (grid, missing)
    assert f'body       {grid} without {", ".join(missing)}\n' in output
    trained = load_controller(path).in_body(options.get('shape', '')).without(missing)
    twin, _ = record_offline(trained, tmp_path, 1.5)
    recording = read_bag(tmp_path / 'bag')
    assert recording.voxel_names == trained.morphology.voxel_names
    for name in ('centers', 'readings', 'actuation', 'spikes', 'applied'):
        np.testing.assert_array_equal(getattr(recording, name)[:-1], getattr(twin, name)[:-1])
    assert len(np.unique(recording.actuation[:-1])) > 1
    # The file with the weights of the nodes is gone; that of the controller is enough.
    assert main(['report', str(tmp_path / 'bag'), '--controller', str(path)]) == 0
    assert 'a cell, per control step' in capsys.readouterr().out
    assert main(['replay', str(tmp_path / 'bag'), '--controller', str(path)]) == 0
    capsys.readouterr()


WITH_ANOTHER_TWIN = """
import sys
from snca_ros import cli
from snca_ros.commands import walk
twin = walk._offline_centers
walk._offline_centers = lambda *arguments: twin(*arguments) + 1e-12
sys.exit(cli.main(sys.argv[4:]))  # behind `python -m snca_ros`
"""


def test_walk_in_lockstep_that_is_not_its_twins_fails(start, make_controller):
    child = start('walk', make_controller('11-10'), '--duration', 0.5, '--bag', 'bag',
                  prefix=(sys.executable, '-c', WITH_ANOTHER_TWIN))
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 1, output
    assert output.endswith('offline twin: 31 positions of the centre, NOT THE SAME\n')


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_killing_the_walk_leaves_no_process(start, make_controller, tmp_path, number):
    child = start('walk', make_controller('11-10'), '--duration', 600, '--bag', 'bag')
    expected = ['recorder_node', 'sim_node', 'voxel_0_0', 'voxel_0_1', 'voxel_1_1']
    wait_until(lambda: sorted(nodes_of(child.pid)) == expected)
    processes = offspring(child.pid)
    wait_until((tmp_path / 'bag').exists)
    os.kill(child.pid, number)
    child.communicate(timeout=LIMIT)
    wait_until(lambda: not any(is_alive(*process) for process in processes.items()))
    if number != signal.SIGKILL:
        assert child.returncode == 130
        assert (tmp_path / 'bag' / 'metadata.yaml').exists()


def test_a_killed_voxel_is_named(start, make_controller):
    child = start('walk', make_controller('11-10'), '--duration', 600, '--no-bag')
    wait_until(lambda: len(nodes_of(child.pid)) == 4)
    os.kill(nodes_of(child.pid)['voxel_0_1'], signal.SIGKILL)
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 1
    assert 'voxel_0_1 ended with code -9' in output


@pytest.mark.parametrize(('given', 'expected'), [
    (['nobody'], ['controller', "'nobody'"]),
    (['CONTROLLER', '--shape', 'cob'], ['morphology', "'cob'", "'comb'"]),
    (['CONTROLLER', '--without', 'voxel_1_0'], ['voxel', "'voxel_1_0'", '11-10']),
    (['CONTROLLER', '--without', 'voxel_0_1'], ['without', "'voxel_0_1'", 'one connected piece']),
    (['CONTROLLER', '--terrain', 'hily'], ['terrain', "'hily'", 'hilly']),
    (['CONTROLLER', '--duration', '-1'], ['duration', '-1']),
    (['CONTROLLER', '--voxels-per-process', '0'], ['--voxels-per-process', '0', 'from 1 to 1000']),
    (['CONTROLLER', '--faults', 'death=voxel_1_0'], ['death', "'voxel_1_0'"]),
    (['CONTROLLER', '--robot', 'a b'], ['robot', "'a b'"]),
    (['CONTROLLER', '--bag', '.'], ['bag', "'.'"]),
])
def test_bad_input_is_named_and_nothing_starts(start, make_controller, tmp_path, given, expected):
    path = make_controller('11-10')
    child = start('walk', *[path if word == 'CONTROLLER' else word for word in given])
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 2, output
    assert len(output.splitlines()) == 1
    for text in expected:
        assert text in output
    assert [p.name for p in tmp_path.iterdir()] == [path.name]


def test_killed_voxels_are_restarted(start, make_controller, tmp_path):
    child = start(
        'walk', make_controller('11-10'), '--duration', 30, '--respawn', '--bag', 'bag'
    )
    victims = 'voxel_0_0', 'voxel_0_1'  # neighbours, each of which needs the other's message
    wait_until((tmp_path / 'bag').exists)
    first = wait_until(lambda: {*victims} <= {*(found := nodes_of(child.pid))} and found)
    wait_until(lambda: (tmp_path / 'bag' / 'bag.mcap').stat().st_size > 100_000)
    for victim in victims:
        os.kill(first[victim], signal.SIGKILL)
    for victim in victims:
        wait_until(lambda name=victim: nodes_of(child.pid).get(name) not in (first[name], None))
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0, output
    assert all(f'voxel_node {name} ended with code -9: restarted' in output for name in victims)
    assert '1801 positions of the centre, the same until step' in output
    counts = read_bag(tmp_path / 'bag').counts
    assert sum(len(count.killed) for count in counts) <= len(victims)
    assert sum(count.lost - len(count.killed) for count in counts) == 0, output


def test_real_time_walk_continues_without_a_killed_voxel(start, make_controller, tmp_path):
    child = start(
        'walk', make_controller('11-10'), '--duration', 6, '--real-time-factor', 2, '--bag', 'bag'
    )
    wait_until((tmp_path / 'bag').exists)
    victim = wait_until(lambda: nodes_of(child.pid).get('voxel_0_1'))
    wait_until(lambda: (tmp_path / 'bag' / 'bag.mcap').stat().st_size > 50_000)
    os.kill(victim, signal.SIGKILL)
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0, output
    assert 'voxel_node voxel_0_1 ended with code -9: the walk continues without it' in output
    assert 'missed deadlines' in output
    assert 'voxel_0_1/spikes at voxel_0_0: ' in output
    assert 'never sent on /robot_11_10/voxel_0_1/actuation' in output
