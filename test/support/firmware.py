"""Builds firmware and runs it on requests, in a process or in an emulated board."""

import contextlib
import select
import shutil
import socket
import subprocess
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest
from support.limits import LIMIT

from sim_node.model.morphology import OPPOSITE, parse_morphology
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cells import Cells
from snca_ros.firmware.boards import BOARDS, EMULATOR
from snca_ros.firmware.folder import cell_sources, write_firmware
from snca_ros.firmware.protocol import HELLO, CellCodec, FrameReader, StepAnswer
from snca_ros.recording.offline import record_episode
from snca_ros.trained_controller import TrainedController

CROSS = 'arm-none-eabi-gcc'
EMULATED = tuple(name for name, board in BOARDS.items() if board.machine)
SESSION = 7

VARIANTS = (  # neuron model, as printed, arithmetic
    *(('snn-h', False, arithmetic) for arithmetic in ('double', 'float32', 'int16', 'int8')),
    ('snn-h', True, 'double'), ('snn-h', True, 'float32'),
    ('mlp', False, 'double'), ('mlp', False, 'float32'),
)

needs_gcc = pytest.mark.skipif(
    not (shutil.which('cc') and shutil.which('make')), reason='needs cc and make'
)
needs_boards = pytest.mark.skipif(
    not (shutil.which(CROSS) and shutil.which(EMULATOR)), reason=f'needs {CROSS} and {EMULATOR}'
)


class Inputs(NamedTuple):
    """What a cell receives in some control steps."""

    steps: np.ndarray  # (n,) control steps
    readings: np.ndarray  # (n, n_sensors)
    inboxes: np.ndarray  # (n, 4, n_c, width)


def untrained(name: str, model: str, shape: str = '11', seed: int = 0, scale: float = 2.0,
              **options) -> TrainedController:
    architecture, morphology = Architecture.named(name, model, **options), parse_morphology(shape)
    n = architecture.n_parameters(morphology.n_voxels)
    weights = np.random.default_rng(seed).uniform(-scale, scale, n)
    return TrainedController(architecture, morphology, weights)


def random_inputs(architecture: Architecture, n: int, seed: int = 0) -> Inputs:
    """Return inputs with all kinds of readings and gaps between the steps."""
    rng = np.random.default_rng(seed)
    shape = n, 4, architecture.n_c, architecture.message_width
    inboxes = rng.uniform(-1.0, 1.0, shape)
    if architecture.spiking:
        rates = rng.choice([0.0, 0.05, 0.3, 1.0], (n, 4, 1, 1))
        inboxes = (rng.random(shape) < rates).astype(float)
    readings = rng.choice([0.0, 1.0, 0.5], (n, len(architecture.sensors)))
    readings = np.where(rng.random(readings.shape) < 0.1, readings, rng.random(readings.shape))
    return Inputs(np.cumsum(rng.choice([1, 1, 1, 1, 30], n)), readings, inboxes)


def walked_inputs(trained: TrainedController, n: int, voxel: int) -> Inputs:
    """Return what a voxel receives in the first steps of a walk."""
    episode = record_episode(
        trained.simulation(), trained.controller(), n / 60.0, ('readings', 'spikes', 'values')
    )
    cell = trained.architecture
    sent = episode.spikes if cell.spiking else episode.values
    sent = sent.reshape(n, -1, cell.n_destinations, cell.n_c, cell.message_width)
    inboxes = np.zeros((n, 4, *sent.shape[3:]))
    for d, neighbor in enumerate(trained.morphology.neighbors[voxel]):
        if neighbor >= 0:
            inboxes[1:, d] = sent[:-1, neighbor, OPPOSITE[d] if cell.directional else 0]
    return Inputs(np.arange(n), episode.readings[:n, voxel], inboxes)


def requests(codec: CellCodec, inputs: Inputs) -> list[bytes]:
    """Return the payloads of hello, reset and all steps."""
    steps = zip(inputs.steps.tolist(), inputs.readings, inputs.inboxes, strict=True)
    return [HELLO, codec.reset(SESSION), *(codec.step(SESSION, *step) for step in steps)]


def write(trained: TrainedController, out: Path) -> Path:
    write_firmware(trained, out, 'a test')
    return out


def build(folder: Path, image: str, board: str = 'posix') -> Path:
    made = f'build/{board}/{image}.elf'
    done = subprocess.run(
        ['make', '-C', folder, f'BOARD={board}', made],
        check=False, text=True, capture_output=True, timeout=LIMIT,
    )
    assert done.returncode == 0, done.stderr
    return folder / made


def answers(image: Path, frames: bytes, n: int, board: str = 'posix') -> list[bytes]:
    """Return the first n payloads that an image answers to frames on its standard input."""
    reader, found = FrameReader(), []
    process = subprocess.Popen(
        BOARDS[board].command(image), stdin=subprocess.PIPE, stdout=subprocess.PIPE
    )
    watchdog = threading.Timer(LIMIT, process.kill)
    watchdog.start()
    feeder = threading.Thread(target=_feed, args=(process, frames))
    feeder.start()
    try:
        while len(found) < n and (received := process.stdout.read1(65536)):
            found += reader.feed(received)
    finally:
        process.kill()
        process.wait()
        feeder.join()
        watchdog.cancel()
        process.stdout.close()
    assert len(found) == n
    assert reader.damaged == 0
    return found


def _feed(process: subprocess.Popen, frames: bytes) -> None:
    try:
        process.stdin.write(frames)
        process.stdin.flush()
    except BrokenPipeError:
        pass


def damaged(data: bytes, chance: np.random.Generator) -> bytes:
    """Return a fifth of all data with a byte flipped, lost or added."""
    if not data or chance.random() >= 0.2:
        return data
    at = chance.integers(len(data))
    other = bytes([data[at] ^ chance.integers(1, 256)])
    kind = chance.integers(3)
    return data[:at] + (b'' if kind == 0 else other) + data[at + (kind < 2) :]


@contextmanager
def noisy_device(image: Path, path: Path, seed: int = 5) -> Iterator[None]:
    """Run an image as a process behind a noisy line, the socket at `path`."""
    chance = np.random.default_rng(seed)
    device, inner = socket.socketpair()
    with device, socket.socket(socket.AF_UNIX) as listening, subprocess.Popen(
        BOARDS['posix'].command(image), stdin=inner, stdout=inner
    ) as process:
        inner.close()
        listening.bind(str(path))
        listening.listen()
        relay = threading.Thread(target=_relay, args=(listening, device, chance))
        relay.start()
        try:
            yield
        finally:
            process.kill()
            listening.shutdown(socket.SHUT_RDWR)
            relay.join()


def _relay(listening: socket.socket, device: socket.socket, chance: np.random.Generator) -> None:
    """Carry damaged data between a host and a device until one of them ends."""
    with contextlib.suppress(OSError):
        host, _ = listening.accept()
        with host:
            others = {host: device, device: host}
            while True:
                for one in select.select([*others], [], [])[0]:
                    if not (data := one.recv(65536)):
                        return
                    others[one].sendall(damaged(data, chance))


def assert_equal_to_cell(
    trained: TrainedController, voxel: int, inputs: Inputs, payloads: list[bytes]
) -> None:
    """Compare the answers of an image with the project's cell, bit for bit."""
    source = source_of(trained, voxel)
    cells, codec = Cells(source.architecture, source.weights[None]), CellCodec(source.architecture)
    found = [codec.decode(payload) for payload in payloads[2:]]
    for k, readings, inbox, answer in zip(*inputs, found, strict=True):
        actuation = cells.step_cell(0, readings, inbox, k)
        assert isinstance(answer, StepAnswer)
        assert (answer.session, answer.step, answer.actuation) == (SESSION, k, actuation)
        assert np.array_equal(answer.outbox, cells.outbox[0])


def source_of(trained: TrainedController, voxel: int):
    sources = [*cell_sources(trained, 'a test').values()]
    return sources[0 if trained.architecture.uniform else voxel]


def image_name(trained: TrainedController, voxel: int) -> str:
    return [*cell_sources(trained, '')][0 if trained.architecture.uniform else voxel]
