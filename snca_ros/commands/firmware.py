"""The `firmware` command: writes a controller's cell as C for microcontrollers."""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

from sim_node.model.constants import Checked, choice
from snca_ros.bundled import DEFAULT_CONTROLLER, find_controller
from snca_ros.cell.models.arithmetic import ARITHMETICS, DEFAULT_ARITHMETIC
from snca_ros.commands.declared_options import add_option
from snca_ros.controller_file import load_controller
from snca_ros.firmware.boards import BOARDS, DEFAULT_BOARD
from snca_ros.firmware.folder import write_firmware

EXAMPLES = """
  snca firmware biped-U-nD-snn-h --out firmware     # doubles, for this computer
  snca firmware runs/tripod/best.npz --out firmware --arithmetic int16 --board microbit
"""


@dataclass(frozen=True)
class FirmwareOptions(Checked):
    """Options of firmware."""

    arithmetic: str = choice(
        DEFAULT_ARITHMETIC, ARITHMETICS, 'arithmetic of the cells; int16 and int8 are for snn and '
        'snn-h only'
    )
    board: str = choice(DEFAULT_BOARD, BOARDS, 'board that `make` builds for')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `firmware`."""
    parser.add_argument('controller', nargs='?', default=DEFAULT_CONTROLLER,
                        help='controller file, run folder, or the name of a bundled one '
                        f'(default {DEFAULT_CONTROLLER})')
    parser.add_argument('--out', type=Path, required=True, metavar='DIR',
                        help='new folder for the C, its Makefile and the weights')
    add_option(parser, FirmwareOptions, 'arithmetic')
    add_option(parser, FirmwareOptions, 'board')


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Write the folder; return the exit code."""
    path = find_controller(args.controller)
    trained = load_controller(path).in_arithmetic(args.arithmetic)
    name = path.stem if path.stem != 'best' else path.absolute().parent.name
    images = write_firmware(trained, args.out, name, args.board)
    listed = images[0] if len(images) == 1 else f'{images[0]} to {images[-1]}'
    print(
        f'{args.out}: {name} in {args.arithmetic} for {args.board} '
        f'({BOARDS[args.board].processor}), {len(images)} image{"s" * (len(images) > 1)} ({listed})'
        f'\nbuild with: make -C {args.out}', file=sys.stderr,
    )
    return 0
