"""The `walk` command: the whole graph up, watched, down; nothing left behind."""

import os
import signal
import threading
from pathlib import Path

import pytest
from conftest import children_of, is_alive

TICK = threading.Event()


def wait_for(condition, seconds=60.0):
    """Poll what no event tells: the state of foreign processes."""
    for _ in range(int(seconds / 0.05)):
        if found := condition():
            return found
        TICK.wait(0.05)
    raise AssertionError('the condition never came true')


def node_of(pid):
    """Return what a child of a walk is: an executable, or the name of a forked voxel."""
    try:
        words = Path(f'/proc/{pid}/cmdline').read_text().split('\0') + [''] * 4
        return words[3] if words[3] != 'walk' else Path(f'/proc/{pid}/comm').read_text().strip()
    except OSError:
        return ''


@pytest.mark.parametrize('faults', ['', 'loss=0.5,death=0.7@0.5-1,broken_actuators=random:0.4@1'])
def test_walk_equals_its_offline_twin(start, make_controller, tmp_path, faults):
    child = start('walk', make_controller('11-10'), '--duration', 1.5, '--bag', 'bag',
                  '--faults', faults)
    output, _ = child.communicate(timeout=90)
    assert child.returncode == 0, output
    assert '91 positions of the centre, bit for bit the same' in output
    assert 'Traceback' not in output
    assert {'metadata.yaml', 'bag.mcap', 'report.png'} <= {
        p.name for p in (tmp_path / 'bag').iterdir()
    }


@pytest.mark.parametrize('number', [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_killing_the_walk_leaves_no_process(start, make_controller, tmp_path, number):
    child = start('walk', make_controller('11-10'), '--duration', 3600, '--bag', 'bag')
    expected = ['recorder_node', 'sim_node', 'voxel_0_0', 'voxel_0_1', 'voxel_1_1']
    wait_for(lambda: sorted(node_of(p) for p in children_of(child.pid)) == expected)
    pids = children_of(child.pid)
    wait_for((tmp_path / 'bag').exists)
    os.kill(child.pid, number)
    child.communicate(timeout=60)
    wait_for(lambda: not any(map(is_alive, pids)))
    if number != signal.SIGKILL:
        assert child.returncode == 130
        assert (tmp_path / 'bag' / 'metadata.yaml').exists()


def test_voxel_that_dies_is_named(start, make_controller):
    child = start('walk', make_controller('11-10'), '--duration', 3600, '--no-bag')
    wait_for(lambda: len(children_of(child.pid)) == 4)
    (victim,) = wait_for(
        lambda: [pid for pid in children_of(child.pid) if node_of(pid) == 'voxel_0_1']
    )
    os.kill(victim, signal.SIGKILL)
    output, _ = child.communicate(timeout=90)
    assert child.returncode == 1
    assert 'voxel_0_1 ended with code -9' in output


@pytest.mark.parametrize(('given', 'expected'), [
    (['nobody'], ['controller', "'nobody'"]),
    (['CONTROLLER', '--shape', 'comb'], ['morphology', "'11-10'", 'comb']),
    (['CONTROLLER', '--terrain', 'hily'], ['terrain', "'hily'", 'hilly']),
    (['CONTROLLER', '--duration', '-1'], ['duration', '-1']),
    (['CONTROLLER', '--voxels-per-process', '0'], ['voxels_per_process', '0']),
    (['CONTROLLER', '--faults', 'death=voxel_1_0'], ['death', "'voxel_1_0'"]),
    (['CONTROLLER', '--robot', 'a b'], ['robot', "'a b'"]),
    (['CONTROLLER', '--bag', '.'], ['bag', "'.'"]),
])
def test_bad_input_is_named_and_nothing_starts(start, make_controller, tmp_path, given, expected):
    path = make_controller('11-10')
    child = start('walk', *[path if word == 'CONTROLLER' else word for word in given])
    output, _ = child.communicate(timeout=60)
    assert child.returncode == 2, output
    assert len(output.splitlines()) == 1
    for text in expected:
        assert text in output
    assert [p.name for p in tmp_path.iterdir()] == [path.name]
