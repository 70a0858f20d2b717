"""Measures firmware: memory and instructions on emulated boards, operations and energy of walks.

python -m benchmarks.firmware [--quick] [--json FILE]

The boards need arm-none-eabi-gcc and qemu-system-arm; without them only operations are counted.
The emulator has no model of cycles: it counts instructions.
"""

import math
import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from benchmarks.command import run_part
from sim_node.control_time import CONTROL_RATE
from snca_ros.bundled import bundled_controllers
from snca_ros.controller_file import load_controller
from snca_ros.firmware.boards import BOARDS, EMULATOR
from snca_ros.firmware.device import DeviceCell
from snca_ros.firmware.folder import cell_sources, write_firmware
from snca_ros.firmware.lines import Address
from snca_ros.recording.energy import count_operations, per_metre, received
from snca_ros.recording.episode import RecordedEpisode
from snca_ros.recording.offline import record_episode
from snca_ros.trained_controller import TrainedController

CROSS = 'arm-none-eabi-'
VARIANTS = {
    'biped-U-nD-snn-h': ('double', 'float32', 'int16', 'int8'),
    'biped-U-D-mlp': ('double', 'float32'),
}
PATIENCE = 60.0  # s


def measure(quick: bool) -> dict:
    boards: list[dict] = []
    if shutil.which(f'{CROSS}gcc') and shutil.which(EMULATOR):
        for name, arithmetics in VARIANTS.items():
            boards += measure_boards(name, arithmetics, 30 if quick else 600)
    walks = [measure_walk(name, 2.0 if quick else 30.0) for name in bundled_controllers()]
    return {'boards': boards, 'walks': walks}


def record(trained: TrainedController, duration: float) -> RecordedEpisode:
    kinds = ('readings', 'spikes', 'values')
    return record_episode(trained.simulation(), trained.controller(), duration, kinds)


def measure_boards(name: str, arithmetics: tuple[str, ...], n_steps: int) -> Iterator[dict]:
    trained = load_controller(bundled_controllers()[name])
    episode, voxel = record(trained, n_steps / CONTROL_RATE), trained.morphology.n_voxels // 2
    sent = episode.spikes if trained.architecture.spiking else episode.values
    assert sent is not None
    messages = [received(trained.architecture, trained.morphology, one)[voxel] for one in sent]
    inboxes = [np.zeros_like(messages[0]), *messages[:-1]]
    for arithmetic in arithmetics:
        one = trained.in_arithmetic(arithmetic)
        (image, source), = cell_sources(one, name).items()
        with tempfile.TemporaryDirectory() as place:
            folder = Path(place, 'firmware')
            write_firmware(one, folder, name)
            for board, about in BOARDS.items():
                if not about.machine:
                    continue
                path = folder / f'build/{board}/{image}.elf'
                make = ['make', '-C', str(folder), f'BOARD={board}']
                subprocess.run(make, check=True, capture_output=True)
                address = Address('unix', f'{place}/{board}')
                command = about.command(path, str(address), counting=True)
                emulator = subprocess.Popen(command)
                device = DeviceCell(address, source.architecture, source.identity)
                try:
                    ticks = []
                    for k, inbox in enumerate(inboxes):
                        device.begin_step(k, episode.readings[k, voxel], inbox, math.inf)
                        answer = device.wait_for_answer(PATIENCE)
                        assert answer is not None
                        ticks.append(answer.ticks)
                finally:
                    device.close()
                    emulator.kill()
                    emulator.wait()
                instructions = np.array(ticks) * 1e9 / device.tick_rate
                yield {
                    'controller': name, 'arithmetic': arithmetic, 'board': board, **memory(path),
                    'mean': float(instructions.mean()), 'most': float(instructions.max()),
                }


def memory(image: Path) -> dict[str, int]:
    """Return bytes of flash, and of RAM without the stack."""
    output = subprocess.run(
        [f'{CROSS}size', image], check=True, capture_output=True, text=True
    ).stdout
    text, data, bss = map(int, output.splitlines()[1].split()[:3])
    return {'flash': text + data, 'ram': data + bss}


def measure_walk(name: str, duration: float) -> dict:
    trained = load_controller(bundled_controllers()[name])
    episode = record(trained, duration)
    operations = count_operations(trained, episode.readings, episode.spikes)
    assert operations is not None
    n_voxels, velocity = trained.morphology.n_voxels, episode.v_x
    found = {
        'controller': name, 'v_x': velocity, 'spikes': operations.spikes,
        'additions': operations.additions, 'updates': operations.updates, 'macs': operations.macs,
    }
    if velocity <= 0.0:  # no energy per metre
        return found
    for kind, integer in (('float', False), ('integer', True))[: 1 + operations.spiking]:
        synapses, neurons = operations.synapse_energy(integer), operations.neuron_energy(integer)
        found[f'synapses {kind}'] = per_metre(synapses, n_voxels, velocity)
        found[f'all {kind}'] = per_metre(synapses + neurons, n_voxels, velocity)
    return found


def table(found: dict) -> str:
    lines = [
        f'{"image":34}{"board":>10}{"flash":>8}{"RAM":>7}{"instructions per step":>23}{"most":>10}'
        f'{"60 Hz":>12}'
    ]
    for row in found['boards']:
        lines.append(
            f'{row["controller"] + " " + row["arithmetic"]:34}{row["board"]:>10}{row["flash"]:>8}'
            f'{row["ram"]:>7}{row["mean"]:>23.0f}{row["most"]:>10.0f}'
            f'{row["most"] * CONTROL_RATE / 1e6:>7.1f} MIPS'
        )
    lines += [
        '', 'of a cell, per control step; of the robot, nJ per metre in floats and in integers',
        f'{"controller":20}{"v_x":>7}{"spikes":>8}{"additions":>11}{"updates":>9}{"MACs":>6}'
        f'{"synapses":>11}{"all":>10}{"synapses":>11}{"all":>10}',
    ]
    for row in found['walks']:
        energies = ''.join(
            f'{row.get(f"{of} {kind}", math.nan):>{width}.1f}'
            for kind in ('float', 'integer') for of, width in (('synapses', 11), ('all', 10))
        )
        lines.append(
            f'{row["controller"]:20}{row["v_x"]:>7.2f}{row["spikes"]:>8.1f}{row["additions"]:>11.1f}'
            f'{row["updates"]:>9}{row["macs"]:>6}{energies}'
        )
    return '\n'.join(lines)


if __name__ == '__main__':
    run_part(__doc__, measure, table)
