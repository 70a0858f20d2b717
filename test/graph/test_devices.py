"""Walks of robots whose cells are on devices: emulated boards of several kinds, and processes."""

import os
import signal

import pytest
from support.firmware import (
    EMULATED,
    build,
    needs_boards,
    needs_gcc,
    noisy_device,
    source_of,
    write,
)
from support.limits import LIMIT
from support.processes import is_alive, nodes_of, offspring, stat_of, wait_until

from snca_ros.controller_file import load_controller

pytestmark = needs_gcc


def boards_of(pid):
    """Return the emulated boards of a walk: id to start time."""
    voxels = [node for name, node in nodes_of(pid).items() if name.startswith('voxel')]
    return {board: start for voxel in voxels for board, start in offspring(voxel).items()}


@pytest.mark.parametrize(('shape', 'name', 'model', 'arithmetic', 'boards'), [
    ('11-10', 'U-nD', 'snn-h', 'int16', 'posix'),
    pytest.param('1111-1001', 'nU-D', 'mlp', 'double', ','.join(EMULATED), marks=needs_boards),
])
def test_walk_on_devices_equals_its_offline_twin(
    start, make_controller, tmp_path, shape, name, model, arithmetic, boards
):
    """One voxel is on a device that the walk does not start, behind a noisy line."""
    path = make_controller(shape, name, model)
    trained = load_controller(path).in_arithmetic(arithmetic)
    folder, own = write(trained, tmp_path / 'firmware'), tmp_path / 'line'
    image = build(folder, 'cell' if trained.architecture.uniform else 'voxel_1_1')
    with noisy_device(image, own):
        child = start(
            'walk', path, '--duration', 1.5, '--bag', 'bag', '--arithmetic', arithmetic,
            '--devices', f'emulated:{boards}', '--device', f'voxel_1_1=unix:{own}',
        )
        output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0, output
    assert '91 positions of the centre, bit for bit the same' in output
    assert 'Traceback' not in output


def test_a_killed_board_is_started_again_and_none_is_left(start, make_controller):
    child = start('walk', make_controller('11-10'), '--duration', 120, '--no-bag',
                  '--devices', 'emulated:posix')
    wait_until(lambda: len(boards_of(child.pid)) == 3)
    before = boards_of(child.pid)
    killed = min(before)
    os.kill(killed, signal.SIGKILL)
    wait_until(lambda: len(set(boards_of(child.pid)) - {killed}) == 3)
    processes = offspring(child.pid) | boards_of(child.pid)
    os.kill(child.pid, signal.SIGKILL)
    child.communicate(timeout=LIMIT)
    wait_until(lambda: not any(is_alive(*process) for process in processes.items()))
    assert stat_of(killed) is None


def test_other_firmware_is_refused_in_one_line(start, make_controller, tmp_path):
    other = load_controller(make_controller('11-10', seed=1))
    image = build(write(other, tmp_path / 'firmware'), 'cell')
    path = make_controller('11-10')
    child = start('walk', path, '--duration', 30, '--no-bag',
                  '--device', f'voxel_1_1=emulated:posix:{image}')
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 1
    expected = source_of(load_controller(path), 0).identity.hash.hex()
    (line,) = [line for line in output.splitlines() if 'error' in line]
    assert line.startswith(f'error: /robot_11_10/voxel_1_1: emulated:posix:{image}: firmware: ')
    assert line.endswith(f'expected that of this voxel in this controller, {expected}')
