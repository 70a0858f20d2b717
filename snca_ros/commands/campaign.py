"""The `campaign` command: evolves and assesses many runs in parallel, resumable at any moment."""

import argparse
import contextlib
import signal
import sys
from concurrent.futures import BrokenExecutor
from pathlib import Path

from sim_node.errors import InvalidInput
from snca_ros.campaign.endpoints import Outcome
from snca_ros.campaign.results import Results
from snca_ros.campaign.scheduler import Campaign, Listener
from snca_ros.campaign.specification import read_campaign
from snca_ros.command_line import INTERRUPTED
from snca_ros.commands.json_output import add_json_option
from snca_ros.commands.worker_options import (
    add_worker_arguments,
    check_workers,
    open_workers,
)
from snca_ros.files import RESULTS, RUNS
from snca_ros.progress import StatusLine

_STOPPED = 'stopped; repeat the command to continue'

EXAMPLES = """
  snca campaign config/experiments/small.yaml       # repeat it to continue
  snca campaign config/experiments/paper-main.yaml --results results/paper --runs runs/paper
  snca campaign config/experiments/small.yaml --scheduler tcp://10.0.0.2:8786
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `campaign`."""
    parser.add_argument('file', type=Path, metavar='FILE', help='campaign file, .yaml')
    parser.add_argument('--results', type=Path, metavar='FOLDER',
                        help='folder of results.csv, histories and controllers '
                        f'(default {RESULTS}/<FILE>)')
    parser.add_argument('--runs', type=Path, metavar='FOLDER', default=RUNS,
                        help=f'folder of the run folders (default {RUNS})')
    add_worker_arguments(parser)
    add_json_option(parser)


class _Printer(Listener):
    """Prints the runs that end, and below them the progress of the campaign."""

    def __init__(self) -> None:
        self._line = StatusLine()

    def clear(self) -> None:
        """Remove the progress, so that other output can follow."""
        self._line.clear()

    def progress(self, campaign: Campaign) -> None:
        self._line.show(campaign.describe())

    def finished(self, outcome: Outcome) -> None:
        row, n = outcome.row, outcome.n_at_wall
        wall = f'; {n} episodes met the wall at the end of the ground' if n else ''
        self._line.clear()
        print(
            f'{row["run"]}: v_x {float(row["v_x_end"]):.3f} m/s, pushed mean '
            f'{float(row["v_x_pushed_mean"]):.3f} ± {float(row["v_x_pushed_std"]):.3f}, '
            f'unseen terrains {float(row["v_x_unseen"]):.3f}, robust '
            f'{float(row["v_x_robust_mean"]):.3f} ± {float(row["v_x_robust_std"]):.3f}{wall}',
            flush=True,
        )

    def failed(self, run: str, reason: str) -> None:
        self._line.clear()
        print(f'{run} failed: {reason}', file=sys.stderr, flush=True)


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Start or resume a campaign; return the exit code."""
    configs = read_campaign(args.file)
    check_workers(args)
    results = Results(args.results or RESULTS / args.file.stem)
    printer = _Printer()
    campaign = Campaign(configs, results, args.runs.resolve(), printer)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        print(campaign.describe(), file=sys.stderr, flush=True)
        while campaign.waiting:
            with contextlib.suppress(BrokenExecutor), open_workers(args) as workers:
                campaign.work(workers)
    except KeyboardInterrupt:
        printer.clear()
        print(f'{_STOPPED}: {campaign.describe()}', file=sys.stderr)
        return INTERRUPTED
    except InvalidInput:  # there are no workers
        printer.clear()
        print(f'{_STOPPED}: {campaign.describe()}', file=sys.stderr)
        raise
    finally:
        results.close()
    printer.clear()
    print(f'{results.path / "results.csv"}: {campaign.describe()}')
    args.write_json({
        'results': str(results.path / 'results.csv'), 'failed': campaign.failed,
        'runs': [results.rows[c.name] for c in configs if c.name in results.rows],
    })
    return 1 if campaign.failed else 0
