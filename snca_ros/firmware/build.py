"""Builds the firmware of a robot for emulated boards."""

import subprocess
from collections.abc import Iterable, Sequence
from pathlib import Path

from sim_node.errors import InvalidInput, check_name
from sim_node.model.morphology import Morphology
from snca_ros.firmware.boards import BOARDS
from snca_ros.firmware.folder import UNIFORM, write_firmware
from snca_ros.firmware.lines import EXPECTED, parse_address
from snca_ros.trained_controller import TrainedController

EMULATED = 'emulated'
"""Prefix of the names of boards that a walk emulates."""


def parse_boards(text: str) -> tuple[str, ...]:
    """Return the boards in the text emulated:BOARD[,BOARD...].

    Raises:
        InvalidInput: the text has another form, or a board is unknown or cannot be emulated here.
    """
    prefix, _, names = text.partition(':')
    if prefix != EMULATED or not names:
        raise InvalidInput('devices', text, f'{EMULATED}:BOARD[,BOARD...]')
    boards = tuple(names.split(','))
    for board in boards:
        check_name('devices', board, BOARDS)
        BOARDS[board].command(Path())
    return boards


def parse_devices(texts: Iterable[str], morphology: Morphology) -> dict[str, str]:
    """Return the addresses of devices by voxel.

    Args:
        texts: VOXEL=ADDRESS each.
        morphology: of the robot.

    Raises:
        InvalidInput: a text has another form, there is no such voxel, or two have one voxel or
            one device.
    """
    found: dict[str, str] = {}
    for text in texts:
        voxel, equals, address = text.partition('=')
        if not equals or voxel in found:
            raise InvalidInput('device', text, f'VOXEL=ADDRESS, one per voxel, with {EXPECTED}')
        morphology.index_of(voxel)
        parsed = parse_address(address)
        if parsed.kind != EMULATED and str(parsed) in found.values():
            raise InvalidInput('device', text, 'another device than that of another voxel')
        found[voxel] = str(parsed)
    return found


def build_devices(
    trained: TrainedController, boards: Sequence[str], folder: Path, name: str
) -> dict[str, str]:
    """Build the images of all voxels; return the address of each voxel's emulated board.

    Args:
        trained: the controller, in the arithmetic of the firmware.
        boards: names of boards; voxels take them in turn.
        folder: a new folder for firmware and images.
        name: name of the controller.

    Raises:
        InvalidInput: there is no C for the controller, or it cannot be built.
    """
    write_firmware(trained, folder, name)
    addresses = {}
    for i, voxel in enumerate(trained.morphology.voxel_names):
        board = boards[i % len(boards)]
        image = f'build/{board}/{UNIFORM if trained.architecture.uniform else voxel}.elf'
        if not (folder / image).exists():
            _make(folder, board, image)
        addresses[voxel] = f'{EMULATED}:{board}:{folder / image}'
    return addresses


def _make(folder: Path, board: str, image: str) -> None:
    """Build one image; InvalidInput with the first line of the compiler's error if that fails."""
    try:
        done = subprocess.run(
            ['make', '-s', '-C', str(folder), f'BOARD={board}', image],
            check=False, capture_output=True, text=True,
        )
        reason = done.stderr.strip().partition('\n')[0] if done.returncode else ''
    except OSError as error:
        reason = f'make: {error.strerror}'
    if reason:
        raise InvalidInput('board', board, f'a board that can be built for ({reason})')
