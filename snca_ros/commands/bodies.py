"""The `bodies` command: searches bodies of every size and number of feet for one controller."""

import argparse
import signal
import sys
from concurrent.futures import BrokenExecutor
from pathlib import Path

import numpy as np

from sim_node.engine import check_engine
from snca_ros.bodies.archive import BodySearch, ScoredBody
from snca_ros.bodies.folder import ARCHIVE, FIGURE, SearchFolder
from snca_ros.bodies.search import check_uniform, search_bodies
from snca_ros.bodies.settings import SearchSettings
from snca_ros.bundled import find_controller
from snca_ros.command_line import INTERRUPTED
from snca_ros.commands.declared_options import add_option
from snca_ros.commands.json_output import add_json_option
from snca_ros.commands.worker_options import (
    add_worker_arguments,
    check_workers,
    open_workers,
)
from snca_ros.controller_file import load_controller
from snca_ros.evolution.tasks import Task, check_task
from snca_ros.progress import StatusLine, TimeLeft

EXAMPLES = """
  snca bodies biped-U-nD-snn-h --out runs/bodies --engine batched   # repeat it to continue
  snca bodies runs/tripod/best.npz --out runs/small --voxels 12 --width 6 --episodes 2000
  snca walk runs/bodies/size-12-feet-3.npz          # an elite, by size and number of feet
"""

_STOPPED = 'stopped; repeat the command to continue'
_OPTIONS = (
    'episodes', 'starts', 'voxels', 'width', 'height', 'batch', 'seed', 'duration', 'engine',
)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `bodies`."""
    parser.add_argument('controller', metavar='CONTROLLER',
                        help='controller file (.npz), run folder, or the name of a bundled one; '
                        'of a uniform architecture')
    parser.add_argument('--out', type=Path, metavar='FOLDER', required=True,
                        help='folder of the search, new or with the same search; it receives a '
                        'controller file per elite')
    for name in _OPTIONS:
        add_option(parser, SearchSettings, name)
    parser.add_argument('--terrain', metavar='NAME',
                        help='ground (default: that of the evolution of the controller)')
    parser.add_argument('--figure', type=Path, metavar='FILE',
                        help=f'draw the archive, .png, .svg or .pdf (default <FOLDER>/{FIGURE})')
    add_worker_arguments(parser)
    add_json_option(parser)


class ProgressLine:
    """Shows the progress of a search.

    Args:
        search: its state at the start.
        task: task of the scores.
    """

    def __init__(self, search: BodySearch, task: Task) -> None:
        settings = search.settings
        self._task, self._starts = task, settings.starts
        self._n_cells = len(settings.frame.cells)
        self._left = TimeLeft(settings.bodies * settings.starts, len(search.scored) * self._starts)
        self._line = StatusLine()

    def __call__(self, search: BodySearch) -> None:
        """Show the state of the search, if the last line is old enough."""
        done, elites = len(search.scored) * self._starts, search.elites
        best = max((one.score for one in elites), default=-np.inf)
        self._line.show(
            f'{done}/{self._left.total} episodes  {self._left.describe(done)}  '
            f'{len(elites)} of {self._n_cells} cells  best {self._task.in_unit(best, 2)}',
        )

    def clear(self) -> None:
        """Remove the line, so that other output can follow."""
        self._line.clear()


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Start or continue a search; return the exit code."""
    from snca_ros.figures import check_figure, write_figure  # matplotlib loads slowly

    opened = open_workers(args)
    trained = load_controller(find_controller(args.controller))
    settings = SearchSettings(
        **{name: getattr(args, name) for name in _OPTIONS},
        terrain=trained.terrain if args.terrain is None else args.terrain,
    )
    check_uniform(trained)
    check_engine(settings.engine, trained.solver)
    task = check_task(trained.task)
    if args.figure:
        check_figure(args.figure)
    BodySearch(settings, trained.morphology)  # raises InvalidInput if pyribs is not installed
    check_workers(args)
    folder = SearchFolder(args.out, settings, trained)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        line = ProgressLine(folder.load(), task)
        with opened as workers:
            search = search_bodies(folder, workers, line)
    except KeyboardInterrupt:
        print(f'\n{_STOPPED}', file=sys.stderr)
        return INTERRUPTED
    except BrokenExecutor:
        print(
            '\na worker process ended unexpectedly (out of memory?); the search is intact up to '
            'the last generation, repeat the command to continue', file=sys.stderr,
        )
        return 1
    finally:
        folder.close()
    line.clear()
    from snca_ros.bodies.figures import draw_archive

    figure = draw_archive(args.controller, search.elites, settings.frame, task)
    write_figure(figure, args.figure or args.out / FIGURE)
    _print_result(folder, search, task)
    args.write_json(_results(folder, search, task))
    return 0


def _print_result(folder: SearchFolder, search: BodySearch, task: Task) -> None:
    """Print the best elite of each number of feet, and the body of the evolution."""
    settings, elites = search.settings, search.elites
    print(
        f'{folder.path / ARCHIVE}: {len(elites)} of {len(settings.frame.cells)} cells, '
        f'{len(search.scored)} bodies, {len(search.scored) * settings.starts} episodes'
    )
    print(f'best of each number of feet, mean {task.label} over {settings.starts} pushed starts:')
    best: dict[int, ScoredBody] = {}
    for one in sorted(elites, key=lambda one: (one.cell[1], one.score)):
        best[one.cell[1]] = one
    for one in best.values():
        print(f'  {folder.file_of(one).name:20}{one.score:9.3f}  {one.body.grid_string}')
    home = [one for one in search.scored if one.body == search.home]
    for one in home:
        print(f'  {"its own body":20}{one.score:9.3f}  {one.body.grid_string}')
    n_met = sum(one.wall_time is not None for one in elites)
    if n_met:
        print(f'{n_met} of {len(elites)} elites met the wall at the end of the ground')


def _results(folder: SearchFolder, search: BodySearch, task: Task) -> dict[str, object]:
    """Return the elites for JSON."""
    return {
        'quantity': task.quantity, 'unit': task.unit, 'starts': search.settings.starts,
        'bodies': len(search.scored), 'episodes': len(search.scored) * search.settings.starts,
        'cells': len(search.settings.frame.cells),
        'elites': [
            {
                'size': one.cell[0], 'feet': one.cell[1], 'grid': one.body.grid_string,
                'mean': one.score, 'scores': one.scores, 'wall_ahead': one.wall_time,
                'controller': str(folder.file_of(one)),
            }
            for one in search.elites
        ],
    }
