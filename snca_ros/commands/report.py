"""The `report` command: a report on the walk in a bag, as text, figure, JSON and page."""

import argparse
from dataclasses import asdict
from pathlib import Path

from sim_node.errors import InvalidInput
from snca_ros.bundled import find_controller
from snca_ros.command_line import FormerlyWithValue
from snca_ros.commands.json_output import add_json_option
from snca_ros.controller_file import load_controller
from snca_ros.files import FIGURE, PAGE, check_writable
from snca_ros.recording.bag import Recording, read_bag
from snca_ros.recording.body import in_body_of
from snca_ros.recording.energy import count_operations, energy_lines
from snca_ros.recording.gait import Gait, measure_gait
from snca_ros.recording.report import as_dict, report_lines
from snca_ros.recording.task_score import score_walk
from snca_ros.trained_controller import TrainedController

EXAMPLES = """
  snca report bags/mine
  snca report bags/mine --json walk.json --figure walk.svg
  snca report bags/mine --json - > walk.json        # text goes to standard error
  snca report bags/mine --html                      # a page that plays the walk
  snca report bags/mine --episode 0                 # of a bag with resets
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `report`."""
    parser.add_argument('bag', type=Path, metavar='BAG', help='rosbag2 folder, MCAP or sqlite3')
    parser.add_argument('--figure', type=Path, metavar='FILE',
                        help='figure to draw, .png, .svg or .pdf '
                        f'(default BAG/{FIGURE})')
    add_json_option(parser)
    parser.add_argument('--html', action=FormerlyWithValue, own_option='--page',
                        is_value=lambda text: text.endswith(('.html', '.htm')),
                        help='write a page that plays the walk')
    parser.add_argument('--page', type=Path, metavar='FILE',
                        help=f'file of that page (default BAG/{PAGE}); implies --html')
    parser.add_argument('--controller', metavar='CONTROLLER',
                        help='controller of the walk in the bag, to add the score by its task '
                        'and the operations of its cells to the report, and thresholds to the page')
    parser.add_argument('--episode', type=int, default=-1, metavar='N',
                        help='number of the episode in a bag with resets, from 0 (default: last)')


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Report on a bag; return the exit code."""
    from snca_ros.figures import check_figure  # matplotlib loads slowly

    if args.figure:
        check_figure(args.figure)
    page = args.page or (args.bag / PAGE if args.html else None)
    if page and args.bag.is_dir():
        check_writable('page', page)
    recording = read_bag(args.bag, args.episode)
    gait = measure_gait(recording)
    print_report(recording, gait, args.figure)
    report = as_dict(recording, gait)
    if args.controller:
        trained = in_body_of(recording, load_controller(find_controller(args.controller)))
        if trained.home:
            print(f'\n{args.controller}, {trained.evolved}, in the body of the bag', flush=True)
        report['task'] = print_task(recording, trained)
        report['operations'] = _print_operations(recording, gait, trained)
    args.write_json(report)
    if page:
        from snca_ros.commands.replay import write_bag_page

        write_bag_page(page, recording, args.controller)
    return 0


def print_task(recording: Recording, trained: TrainedController) -> dict:
    """Print the score of the walk by the task of its controller; return it for JSON."""
    found = score_walk(recording, trained)
    print(found.line, flush=True)
    return asdict(found)


def _print_operations(
    recording: Recording, gait: Gait, trained: TrainedController
) -> dict | None:
    """Print operations and energy of the cells; return the operations, None if unknown."""
    operations = count_operations(trained, recording.readings, recording.spikes)
    if operations is None:
        return None
    lines = energy_lines(operations, len(recording.voxel_names), gait.velocity)
    print('\n'.join(lines), flush=True)
    return asdict(operations)


def print_report(recording: Recording, gait: Gait, figure: Path | None = None) -> None:
    """Print the report on a recording, and draw its figure.

    Args:
        recording: the recording.
        gait: its gait.
        figure: file of the figure; None for one in the bag, or none if the bag is read-only.

    Raises:
        InvalidInput: `figure` cannot be written.
    """
    from snca_ros.figures import write_figure
    from snca_ros.recording.figures import draw_recording

    print('\n'.join(report_lines(recording, gait)), flush=True)
    path = figure or recording.path / FIGURE
    try:
        write_figure(draw_recording(recording), path)
    except InvalidInput as error:
        if figure:
            raise
        print(f'\nno figure, the bag cannot be written; name a file by --figure ({error})')
        return
    print(f'\nfigure: {path}')
