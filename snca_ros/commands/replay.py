"""The `replay` command: writes a page that plays the walk of a controller, a run or a bag."""

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path

from sim_node.control_time import CONTROL_RATE
from sim_node.errors import InvalidInput
from sim_node.model.constants import Checked, constant
from snca_ros.bundled import find_controller
from snca_ros.commands.body_options import add_body_options
from snca_ros.commands.declared_options import add_option
from snca_ros.evolution.episode import EPISODE, LONGEST
from snca_ros.faults import FAULTS_HELP
from snca_ros.files import PAGE, write_text
from snca_ros.recording.bag import Recording, read_bag
from snca_ros.web.replay import bag_page, controller_page

EXAMPLES = """
  snca replay biped-U-nD-snn-h                      # writes biped-U-nD-snn-h.html
  snca replay biped-U-nD-snn-h hills.html --terrain hilly-1-10-0 --duration 60
  snca replay biped-U-nD-snn-h tripod.html --shape tripod --without voxel_1_1
  snca replay runs/tripod                           # best.npz, with the history of the run
  snca replay bags/mine --controller biped-U-nD-snn-h
"""


@dataclass(frozen=True)
class ReplayOptions(Checked):
    """The walk that a page plays."""

    duration: float = constant(EPISODE, 1 / CONTROL_RATE, LONGEST, 'duration of the walk', 's')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `replay`."""
    parser.add_argument('source', metavar='CONTROLLER|RUN|BAG',
                        help='controller file or name of a bundled one, run folder of evolve '
                        '(best.npz, with the history of the run), or bag')
    parser.add_argument('out', type=Path, nargs='?', metavar='FILE',
                        help=f'page to write (default {PAGE} in the run folder or bag; '
                        'NAME.html for a controller)')
    parser.add_argument('--episode', type=int, default=-1, metavar='N',
                        help='number of the episode in a bag with resets, from 0 (default: last)')
    parser.add_argument('--controller', metavar='CONTROLLER',
                        help='controller of the walk in the bag, to add thresholds to the page')
    walk = parser.add_argument_group('the walk of a controller')
    add_option(walk, ReplayOptions, 'duration')
    walk.add_argument('--terrain', default='', help='terrain (default: that of its evolution)')
    add_body_options(walk)
    walk.add_argument('--faults', default='', metavar='SPEC', help=FAULTS_HELP)


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Write the page; return the exit code."""
    source = Path(args.source)
    is_run = (source / 'config.yaml').exists()
    if source.is_dir() and not is_run:
        if args.terrain or args.faults or args.shape or args.without:
            parser.error('--terrain, --shape, --without and --faults are for controllers and runs, '
                         'not for bags')
        recording = read_bag(source, args.episode)
        write_bag_page(args.out or source / PAGE, recording, args.controller)
        return 0
    if args.controller or args.episode != -1:
        parser.error('--controller and --episode are for bags')
    file = source / 'best.npz' if is_run else find_controller(args.source)
    page = controller_page(
        file, args.duration, args.terrain, args.faults, source if is_run else None, args.shape,
        args.without,
    )
    _write_page(args.out or (source / PAGE if is_run else Path(f'{file.stem}.html')), page)
    return 0


def write_bag_page(path: Path, recording: Recording, controller: str | None) -> None:
    """Write the page of a recorded walk, and print its path and any warning.

    Raises:
        InvalidInput: the bag has no markers, the controller is of another robot, or `path` cannot
            be written.
    """
    page, warning = bag_page(recording, controller)
    _write_page(path, page)
    if warning:
        print(warning, file=sys.stderr)


def _write_page(path: Path, page: str) -> None:
    try:
        write_text(path, page)
    except OSError as error:
        raise InvalidInput('html', f'{path}: {error.strerror}', 'a file that can be written') \
            from None
    print(f'page: {path}, {len(page) / 1e6:.1f} MB')
