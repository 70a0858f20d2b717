"""The cell on a device as the host sees it: lines, repeats, restarts, wrong firmware."""

import os
import signal
import socket
import subprocess
import sys
import time
from contextlib import contextmanager

import numpy as np
import pytest
from support.firmware import (
    build,
    damaged,
    needs_gcc,
    random_inputs,
    source_of,
    untrained,
    write,
)
from support.limits import LIMIT
from support.paths import ROOT
from support.processes import offspring, stat_of, wait_until_gone

from sim_node.errors import InvalidInput
from snca_ros.cell.cells import Cells
from snca_ros.firmware.boards import BOARDS
from snca_ros.firmware.device import REPEAT_AFTER, DeviceCell, DeviceCounts
from snca_ros.firmware.lines import parse_address
from snca_ros.firmware.protocol import CellCodec, FrameReader, SessionAnswer, frame

TRAINED = untrained('U-nD', 'snn-h', arithmetic='int16')
INPUTS = random_inputs(TRAINED.architecture, 60)


@pytest.fixture(scope='module')
def image(tmp_path_factory):
    return build(write(TRAINED, tmp_path_factory.mktemp('device') / 'firmware'), 'cell')


@contextmanager
def running(*command, **options):
    process = subprocess.Popen([*map(str, command)], **options)
    try:
        yield process
    finally:
        process.kill()
        process.wait()


@contextmanager
def connected(address, trained=TRAINED):
    source = source_of(trained, 0)
    device = DeviceCell(parse_address(address), source.architecture, source.identity)
    try:
        yield device
    finally:
        device.close()


def a_cell(trained=TRAINED):
    return Cells(trained.architecture, source_of(trained, 0).weights[None])


def check_steps(device, steps, cells, before=lambda i: None):
    """Step the device and a cell of the project; compare their answers."""
    for i in steps:
        before(i)
        k, readings, inbox = (array[i] for array in INPUTS)
        device.begin_step(int(k), readings, inbox, time.monotonic())
        answer = device.wait_for_answer(LIMIT)
        assert answer is not None
        assert answer.actuation == cells.step_cell(0, readings, inbox, k)
        assert np.array_equal(answer.outbox, cells.outbox[0])


@needs_gcc
def test_unix_socket_and_resets(image, tmp_path):
    path = tmp_path / 'line'
    with running(*BOARDS['posix'].command(image, f'unix:{path}')):
        for _ in range(2):  # a host that comes back
            with connected(f'unix:{path}') as device:
                assert not device.ready
                for _ in range(2):
                    check_steps(device, range(10), a_cell())
                    assert not device.waiting
                    device.reset()
                counts = device.counts
                assert counts == DeviceCounts(repeats=counts.repeats)  # of a busy machine
                assert device.tick_rate == 10**9


@needs_gcc
def test_serial_line(image):
    with running(image, 'pty', stdout=subprocess.PIPE, text=True) as process:
        name = process.stdout.readline().strip()
        for _ in range(2):
            with connected(f'serial:{name}@115200') as device:
                check_steps(device, range(10), a_cell())


@needs_gcc
def test_datagrams_of_other_senders_are_ignored(image):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(('127.0.0.1', 0))
        port = free.getsockname()[1]
    with running(image, f'udp:{port}'), connected(f'udp:127.0.0.1:{port}') as device:
        cells = a_cell()
        check_steps(device, range(10), cells)
        with socket.socket(fileno=os.dup(device.fileno())) as own:
            host = own.getsockname()
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as stranger:
            def lie(i):
                for answer in (b'n' + b'\1\0', b's' + bytes(30), b'noise'):
                    stranger.sendto(frame(answer), host)

            check_steps(device, range(10, 30), cells, before=lie)
        assert device.counts.restarts == device.counts.damaged == 0


class NoisyLine:
    """A line that flips, loses or adds a byte in a fifth of what it carries."""

    def __init__(self, line, chance):
        self._line, self._chance = line, chance
        self.fileno, self.close = line.fileno, line.close

    def write(self, data):
        self._line.write(damaged(data, self._chance))

    def read(self):
        return damaged(self._line.read(), self._chance)


@needs_gcc
def test_a_noisy_line_costs_repeats_but_changes_nothing(image):
    chance = np.random.default_rng(5)
    address = parse_address(f'emulated:posix:{image}')
    source = source_of(TRAINED, 0)

    class NoisyAddress(type(address)):
        def open(self):
            return NoisyLine(super().open(), chance)

    noisy = NoisyAddress(address.kind, address.place, board=address.board)
    device = DeviceCell(noisy, source.architecture, source.identity)
    try:
        check_steps(device, range(60), a_cell())
    finally:
        device.close()
    assert device.counts.repeats > 5
    assert device.counts.damaged > 0
    assert device.counts.restarts == device.counts.losses == 0


@needs_gcc
def test_a_killed_device_starts_afresh(image, tmp_path):
    """Its cell is reset, as that of a process that has been restarted; the step is repeated."""
    path = tmp_path / 'line'
    command = BOARDS['posix'].command(image, f'unix:{path}')
    with connected(f'unix:{path}') as device:
        with running(*command):
            check_steps(device, range(20), a_cell())
        device.begin_step(int(INPUTS.steps[20]), INPUTS.readings[20], INPUTS.inboxes[20], 0.0)
        assert device.wait_for_answer(0.2) is None
        assert device.waiting
        with running(*command):
            answer = device.wait_for_answer(LIMIT)
            cells = a_cell()
            k, readings, inbox = (array[20] for array in INPUTS)
            assert answer.actuation == cells.step_cell(0, readings, inbox, k)
            check_steps(device, range(21, 40), cells)
        assert device.counts.losses == 1


def test_a_device_that_is_not_there_is_told_and_tried_again():
    """The line may also be gone at the first write, as that of an adapter being unplugged."""
    class Gone:
        def write(self, data):
            raise BrokenPipeError(32, 'Broken pipe')

        def close(self):
            pass

    address, source = parse_address('unix:/tmp/none'), source_of(TRAINED, 0)

    class GoneAddress(type(address)):
        def open(self):
            return Gone()

    for where, reason in ((address, 'No such file or directory'),
                          (GoneAddress('unix', 'gone'), 'Broken pipe')):
        device = DeviceCell(where, source.architecture, source.identity)
        for now in (1.0, 1.01, 2.0):
            assert device.poll(now) is None
            assert device.trouble == f'{where}: {reason}'
        assert device.counts == DeviceCounts()


@needs_gcc
def test_other_firmware_is_refused(image, tmp_path):
    path, other = tmp_path / 'line', untrained('U-nD', 'snn-h', arithmetic='int16', seed=1)
    command = BOARDS['posix'].command(image, f'unix:{path}')
    with running(*command), connected(f'unix:{path}', other) as device:
        with pytest.raises(InvalidInput) as caught:
            device.wait_for_answer(LIMIT)
        text = str(caught.value)
        assert text.startswith(f"unix:{path}: firmware: got 'a test, ")
        assert 'expected that of this voxel in this controller, ' in text


@needs_gcc
def test_an_emulated_board_runs_as_long_as_its_line_and_is_started_again(image):
    before = offspring(os.getpid())
    with connected(f'emulated:posix:{image}') as device:
        check_steps(device, range(10), a_cell())
        (board,) = set(offspring(os.getpid())) - set(before)
        os.kill(board, signal.SIGKILL)
        check_steps(device, range(10, 20), a_cell())
        assert device.counts.losses == 1
        (again,) = set(offspring(os.getpid())) - set(before)
        assert again != board
    assert offspring(os.getpid()) == before


@needs_gcc
def test_an_emulated_board_ends_with_a_host_that_is_killed(image):
    host = subprocess.Popen([sys.executable, '-c', HOST, str(image)], stdout=subprocess.PIPE,
                            env={**os.environ, 'PYTHONPATH': str(ROOT)}, text=True)
    board = int(host.stdout.readline())
    started = stat_of(board)[2]
    host.kill()
    host.wait()
    host.stdout.close()
    wait_until_gone({board: started})


HOST = """
import sys
from snca_ros.firmware.emulated_line import EmulatedLine
line = EmulatedLine('posix', sys.argv[1])
print(line._process.pid, flush=True)
sys.stdin.read() or __import__('signal').pause()
"""


class BadLine:
    """A device whose answers a test writes, and whose requests it reads."""

    def __init__(self, path):
        self._listening = socket.socket(socket.AF_UNIX)
        self._listening.bind(str(path))
        self._listening.listen()
        self._reader, self._rest = FrameReader(), []

    def accept(self):
        self._socket, _ = self._listening.accept()

    def request(self):
        while not self._rest:
            self._rest += self._reader.feed(self._socket.recv(65536))
        return self._rest.pop(0)

    def answer(self, payload):
        self._socket.sendall(frame(payload))

    def close(self):
        self._socket.close()
        self._listening.close()


@pytest.fixture
def bad_line(tmp_path):
    line = BadLine(tmp_path / 'line')
    with connected(f'unix:{tmp_path / "line"}') as device:
        yield line, device
    line.close()


def hello(session):
    identity = source_of(TRAINED, 0).identity
    sizes = bytes([1, 2, identity.n_sensors, identity.n_c, identity.n_destinations])
    return b'h' + sizes + identity.hash + session.to_bytes(2, 'little') + bytes(4) + b'x'


def test_repeats_wait_and_late_answers_are_not_taken_for_others(bad_line):
    line, device = bad_line
    codec = CellCodec(TRAINED.architecture)
    step = [int(INPUTS.steps[0]), INPUTS.readings[0], INPUTS.inboxes[0]]
    device.begin_step(*step, now=10.0)
    device.poll(10.0)
    line.accept()
    assert line.request() == b'H'
    device.poll(10.0 + 0.9 * REPEAT_AFTER)
    assert device.counts.repeats == 0
    device.poll(10.0 + 1.1 * REPEAT_AFTER)
    assert device.counts.repeats == 1
    assert line.request() == b'H'
    line.answer(hello(65535))
    line.answer(hello(65535))  # the answer to the repeated one
    device.poll(11.0)
    assert line.request() == codec.reset(1)  # another session than the device was in
    line.answer(b's\xff\xff' + bytes(20))  # of a session before
    line.answer(b'n\xff\xff')
    device.poll(11.01)
    line.answer(b'r\1\0')
    line.answer(b'r\1\0')
    device.poll(11.02)
    asked = line.request()
    assert asked == codec.step(1, *step)
    size = 7 + 2 + 2 * 4 + 4
    device.poll(11.02 + 2.1)
    assert device.trouble.endswith(': no answer')
    assert line.request() == asked
    for wrong in (b's\2\0' + asked[3:7], b's' + asked[1:3] + b'\7\0\0\0'):
        line.answer(wrong.ljust(size, b'\0'))
        assert device.poll(11.03) is None
    line.answer((b's' + asked[1:7]).ljust(size, b'\0'))
    answer = device.poll(11.04)
    assert (answer.step, answer.actuation) == (step[0], 0.0)
    assert device.trouble == ''
    line.answer((b's' + asked[1:7]).ljust(size, b'\0'))
    assert device.poll(11.05) is None
    assert not device.waiting
    device.poll(20.0)
    assert device.counts == DeviceCounts(repeats=2)


def test_a_device_that_lost_its_session_is_asked_who_it_is(bad_line):
    line, device = bad_line
    codec = CellCodec(TRAINED.architecture)
    step = [int(INPUTS.steps[0]), INPUTS.readings[0], INPUTS.inboxes[0]]
    device.begin_step(*step, now=10.0)
    device.poll(10.0)
    line.accept()
    for payload, answer in (
        (b'H', hello(0)), (codec.reset(1), b'r\1\0'), (codec.step(1, *step), b'n\0\0'),
        (b'H', hello(0)), (codec.reset(1), b'r\1\0'),
    ):
        assert line.request() == payload
        line.answer(answer)
        device.poll(10.01)
    assert line.request() == codec.step(1, *step)
    assert device.counts.restarts == 1
    assert codec.decode(b'n\0\0') == SessionAnswer(False, 0)


@pytest.mark.parametrize('text', [
    'serial:/dev/ttyACM0@115200', 'udp:10.0.0.7:5000', 'unix:/tmp/cell', 'udp:::1:5000',
    f'emulated:posix:{__file__}',
])
def test_addresses_are_read_and_shown(text):
    assert str(parse_address(text)) == text


@pytest.mark.parametrize(('text', 'expected'), [
    ('', 'serial:PATH@BAUD'), ('serial:/dev/ttyACM0', 'serial:PATH@BAUD'), ('unix:', 'unix:PATH'),
    ('tcp:host:1', 'serial:PATH@BAUD'), ('serial:/dev/ttyACM0@12345', 'one of the baud rates'),
    ('emulated:posix', 'emulated:BOARD:IMAGE'), ('emulated:posix:none', 'an image, built by'),
    ('udp:host:70000', 'a port from 1 to 65535'), ('udp::5', 'udp:HOST:PORT'),
])
def test_other_addresses_are_refused(text, expected):
    with pytest.raises(InvalidInput, match=f'^device: got .*{expected}'):
        parse_address(text)
    with pytest.raises(InvalidInput, match='one of posix, microbit'):
        parse_address(f'emulated:arduino:{__file__}')


def test_an_image_for_another_processor_is_refused(tmp_path):
    image = tmp_path / 'cell.elf'
    image.write_bytes(b'\x7fELF'.ljust(18, b'\0') + b'\x28\0')
    with pytest.raises(InvalidInput, match='an image for posix, built by `make BOARD=posix`'):
        parse_address(f'emulated:posix:{image}')


def test_slow_lines_have_longer_limits():
    """At 9600 baud, two frames of 51 bytes take 0.1 s."""
    slow, fast = parse_address('serial:/dev/ttyS0@9600'), parse_address('udp:host:1')
    assert slow.duration(102) == pytest.approx(0.10625)
    assert fast.duration(102) < 0.001
