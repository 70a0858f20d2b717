"""The `history` command: shows the progress of runs, as text and as a figure."""

import argparse
import shutil
import sys
import time
from collections.abc import Sequence
from pathlib import Path

from snca_ros.commands.json_output import add_json_option
from snca_ros.evolution.history import History, describe, read_histories
from snca_ros.progress import fit

EXAMPLES = """
  snca history runs/tripod
  snca history runs/tripod --watch                  # updates after every generation
  snca history runs/* --figure histories.png
  snca history results/example                      # all runs of a campaign
"""

_POLL_PERIOD = 1.0  # s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `history`."""
    parser.add_argument('runs', nargs='+', type=Path, metavar='RUN',
                        help='run folder of evolve, a history.csv, or the results folder of a '
                        'campaign or one of its histories')
    parser.add_argument('--watch', action='store_true',
                        help='update after every generation, until all runs are finished')
    parser.add_argument('--figure', type=Path, metavar='FILE',
                        help='draw a figure, .png, .svg or .pdf')
    add_json_option(parser)


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Print and draw histories; return the exit code."""
    shown: list[str] = []
    live = args.watch and sys.stdout.isatty()
    width = shutil.get_terminal_size().columns if live else None
    while True:
        histories = [history for path in args.runs for history in read_histories(path)]
        finished = not args.watch or all(history.finished for history in histories)
        lines = [fit(line, width) if width else line
                 for history in histories for line in describe(history)]
        if lines != shown:
            if args.figure:
                _draw(histories, args.figure)
            if live and shown:  # overwrite the lines
                print(f'\x1b[{len(shown)}F\x1b[J', end='')
            if live or finished:
                print('\n'.join(lines), flush=True)
            shown = lines
        if finished:
            args.write_json([history.as_dict() for history in histories])
            return 0
        time.sleep(_POLL_PERIOD)


def _draw(histories: Sequence[History], path: Path) -> None:
    from snca_ros.evolution.figures import draw_histories  # matplotlib loads slowly
    from snca_ros.figures import write_figure

    names, tables = [h.name for h in histories], [h.rows for h in histories]
    label = ', '.join(dict.fromkeys(h.label for h in histories))
    write_figure(draw_histories(names, tables, label), path)
