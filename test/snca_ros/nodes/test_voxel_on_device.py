"""A voxel whose cell is on a device that answers late, or never, or says who it is."""

import numpy as np
import pytest
from support.voxel_world import NoSimulations

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from snca_ros.cell.architecture import Architecture
from snca_ros.faults import CellFaults, Faults, VoxelFaults
from snca_ros.firmware.build import parse_boards, parse_devices
from snca_ros.nodes.own_cell import CellStep
from snca_ros.nodes.own_part import OwnPart
from snca_ros.nodes.voxel_core import VoxelCore

EPISODE, OTHER = b'r0000001', b'r0000002'
SHAPE = parse_morphology('11')


class SlowDevice:
    """A cell whose results a test makes."""

    def __init__(self):
        self.asked, self.result, self.resets = [], None, 0

    def reset(self):
        self.resets, self.result = self.resets + 1, None

    def begin_step(self, step, readings, inbox, now):
        self.asked.append((step, readings[0]))

    def poll(self, now):
        result, self.result = self.result, None
        return result

    def answer(self, actuation):
        self.result = CellStep(self.asked[-1][0], actuation, np.full((1, 1, 1), actuation))

    def counts(self):
        return {'device repeats': 3}


def make_core(real_time=False, death=''):
    cell = Architecture.named('U-nD', 'mlp', n_c=1)
    device = SlowDevice()
    faults = VoxelFaults(CellFaults(Faults(death=death), SHAPE), 0)
    core = VoxelCore(
        OwnPart(cell, device, faults, 'reference'), [], patience=0.0, real_time=real_time,
        horizon=1000, simulations=NoSimulations(),
    )
    core.joined = True
    return core, device


def sense(core, step, episode=EPISODE):
    core.receive_sensors(episode, step, np.full(4, step / 100.0), float(step))


def test_a_step_is_answered_when_the_device_answers():
    core, device = make_core()
    sense(core, 0)
    for _ in range(3):
        assert core.answer(0.0) is None
        assert core.cell.busy
        assert core.unanswered
    assert device.asked == [(0, 0.0)]
    device.answer(0.25)
    answer = core.answer(0.1)
    assert (answer.episode, answer.step, answer.actuation) == (EPISODE, 0, 0.25)
    assert answer.outbox.tolist() == [[[0.25]]]
    assert not core.unanswered
    assert core.answer(0.2) is None
    assert core.cell.counts() == {'device repeats': 3}


def test_in_real_time_the_newest_sensors_wait_for_a_slow_device():
    core, device = make_core(real_time=True)
    for step in range(100, 104):
        sense(core, step)
        assert core.answer(0.0) is None
    device.answer(0.5)
    assert core.answer(0.0).step == 100
    assert core.unanswered
    assert core.answer(0.0) is None
    device.answer(0.25)
    assert core.answer(0.0).step == 103
    assert device.asked == [(100, 1.0), (103, 1.03)]


def test_a_new_episode_gives_up_the_step():
    core, device = make_core()
    sense(core, 0)
    core.answer(0.0)
    sense(core, 0, OTHER)
    assert not core.cell.busy
    core.answer(0.0)
    device.answer(0.5)
    assert core.answer(0.0).episode == OTHER
    assert device.asked == [(0, 0.0), (0, 0.0)]


def test_a_dead_voxel_resets_its_device_and_needs_no_answer():
    core, device = make_core(death='1@0')
    sense(core, 0)
    resets = device.resets
    answer = core.answer(0.0)
    assert (answer.actuation, answer.outbox.any()) == (0.0, False)
    assert device.asked == []
    assert device.resets == resets + 1


def test_devices_of_a_walk_are_read():
    given = ['voxel_0_0=udp:10.0.0.7:5000', 'voxel_1_0=serial:/dev/ttyACM0@115200']
    assert parse_devices(given, SHAPE) == {
        'voxel_0_0': 'udp:10.0.0.7:5000', 'voxel_1_0': 'serial:/dev/ttyACM0@115200',
    }
    assert parse_boards('emulated:posix,posix') == ('posix', 'posix')


@pytest.mark.parametrize(('given', 'message'), [
    (['udp:10.0.0.7:5000'], 'expected VOXEL=ADDRESS'),
    (['voxel_5_5=unix:/tmp/a'], 'voxel_5_5'),
    (['voxel_0_0=unix:/tmp/a', 'voxel_0_0=unix:/tmp/b'], 'one per voxel'),
    (['voxel_0_0=unix:/tmp/a', 'voxel_1_0=unix:/tmp/a'], 'another device than that of another'),
    (['voxel_0_0=tty'], 'expected serial:PATH@BAUD'),
])
def test_other_devices_are_refused(given, message):
    with pytest.raises(InvalidInput, match=message):
        parse_devices(given, SHAPE)


@pytest.mark.parametrize(('text', 'message'), [
    ('microbit', 'expected emulated:BOARD'), ('emulated:', 'expected emulated:BOARD'),
    ('emulated:posix,arduino', 'one of posix, microbit'),
])
def test_other_boards_are_refused(text, message):
    with pytest.raises(InvalidInput, match=message):
        parse_boards(text)
