"""The `campaign` command: many runs side by side, evolved and assessed, resumable at any moment."""

import argparse
import contextlib
import signal
import sys
from collections import deque
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from sim_node.errors import InvalidInput
from snca_ros.campaign.endpoints import Outcome, perform
from snca_ros.campaign.results import Results
from snca_ros.campaign.specification import read_campaign
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.workers import Workers, add_worker_arguments, open_workers
from snca_ros.progress import StatusLine, TimeLeft

INTERRUPTED = 130
_TELL_EVERY = 1.0  # s
_GOES_ON = 'stopped; the same command goes on with it'


class Campaign:
    """The runs of a campaign: waiting, running, failed, or finished and in the results.

    Args:
        configs: the runs, in the order in which to start them.
        results: where finished ones have their rows.
        runs: folder of the run folders, on all workers the same.
    """

    def __init__(self, configs: Sequence[RunConfig], results: Results, runs: Path) -> None:
        self.configs, self.results, self.runs = configs, results, runs
        self.waiting = deque(c for c in configs if c.name not in results.rows)
        self.running: dict[Future[Outcome], RunConfig] = {}
        self.failed: dict[str, str] = {}
        self._suspects: set[str] = set()  # one of them has ended its worker process
        self._at_once = 1  # of the suspects
        self._line = StatusLine()
        self._left = TimeLeft(sum(c.evaluations for c in configs), self._evaluations())

    def work(self, workers: Workers) -> None:
        """Perform what waits, as many runs at a time as there are workers.

        When a local worker process ends, nobody knows whose fault it was: all that were running
        are tried again, half as many at a time, until one ends its process alone and has failed.

        Raises:
            BrokenExecutor, CancelledError: a worker process ended, or the cluster is lost; what
                was running waits again, or has failed.
        """
        try:
            while self.waiting or self.running:
                most = self._at_once if self._suspects else workers.count()
                while self.waiting and len(self.running) < most:
                    config = self.waiting[0]
                    future = workers.executor.submit(perform, config, self.runs / config.name)
                    self.running[future] = self.waiting.popleft()
                done, _ = wait(self.running, _TELL_EVERY, FIRST_COMPLETED)
                for future in done:
                    self._finish(future)
                self._line.show(self.told())
        except (BrokenExecutor, CancelledError) as error:
            self._put_back(isinstance(error, BrokenProcessPool))
            raise

    def _finish(self, future: Future[Outcome]) -> None:
        try:
            outcome = future.result()
        except (BrokenExecutor, CancelledError):
            raise
        except Exception as error:
            self._fail(self.running.pop(future), f'{type(error).__name__}: {error}')
            return
        config = self.running.pop(future)
        self._suspects.discard(config.name)
        self.results.add(outcome)
        row = self.results.rows[config.name]
        self._line.clear()
        print(
            f'{config.name}: v_x {float(row["v_x_end"]):.3f} m/s, pushed mean '
            f'{float(row["v_x_pushed_mean"]):.3f} ± {float(row["v_x_pushed_std"]):.3f}, '
            f'unseen terrains {float(row["v_x_unseen"]):.3f}, robust '
            f'{float(row["v_x_robust_mean"]):.3f} ± {float(row["v_x_robust_std"]):.3f}',
            flush=True,
        )

    def _put_back(self, a_process_ended: bool) -> None:
        configs = list(self.running.values())
        self.running.clear()
        if a_process_ended and len(configs) == 1 and configs[0].name in self._suspects:
            self._fail(configs[0], 'it ended its worker process again, alone (out of memory?)')
            self._suspects.clear()
            return
        self.waiting.extendleft(reversed(configs))
        if a_process_ended:
            self._suspects.update(config.name for config in configs)
            self._at_once = max(1, len(configs) // 2)

    def _fail(self, config: RunConfig, reason: str) -> None:
        self.failed[config.name] = reason
        self._suspects.discard(config.name)
        self._line.clear()
        print(f'{config.name} failed: {reason}', file=sys.stderr, flush=True)

    def _evaluations(self) -> int:
        """Return the evaluations spent so far, by the histories of the run folders."""
        return sum(
            c.evaluations if c.name in self.results.rows else _spent(self.runs / c.name)
            for c in self.configs
        )

    def told(self) -> str:
        """Return what is done, running and left, and the time left, as text."""
        done = sum(c.name in self.results.rows for c in self.configs)
        text = (
            f'{done} of {len(self.configs)} runs done, {len(self.running)} running, '
            f'{len(self.waiting)} waiting, {len(self.failed)} failed'
        )
        if not (self.waiting or self.running):
            return text
        return f'{text}; evaluations {self._left.told(self._evaluations())}'


def _spent(folder: Path) -> int:
    try:
        return int((folder / 'history.csv').read_text().splitlines()[-1].split(',')[1])
    except (OSError, ValueError, IndexError):  # none yet
        return 0


EXAMPLES = """
  snca campaign config/experiments/small.yaml       # again: goes on with it
  snca campaign config/experiments/paper-main.yaml --results results/paper --runs runs/paper
  snca campaign config/experiments/small.yaml --scheduler tcp://10.0.0.2:8786
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `campaign`."""
    parser.add_argument('file', type=Path, metavar='FILE', help='the campaign, .yaml')
    parser.add_argument('--results', type=Path, metavar='FOLDER',
                        help='results.csv, histories and controllers (default results/<FILE>)')
    parser.add_argument('--runs', type=Path, metavar='FOLDER', default=Path('runs'),
                        help='run folders (default runs)')
    add_worker_arguments(parser)


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Run, or go on with, a campaign as the command line says; return the exit code."""
    open_workers(args, parser)  # checks the options
    configs = read_campaign(args.file)
    results = Results(args.results or Path('results') / args.file.stem)
    campaign = Campaign(configs, results, args.runs.resolve())
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        print(campaign.told(), file=sys.stderr, flush=True)
        while campaign.waiting:
            with contextlib.suppress(BrokenExecutor), open_workers(args, parser) as workers:
                campaign.work(workers)
    except KeyboardInterrupt:
        print(f'\n{_GOES_ON}: {campaign.told()}', file=sys.stderr)
        return INTERRUPTED
    except InvalidInput:  # no workers, or no more
        print(f'{_GOES_ON}: {campaign.told()}', file=sys.stderr)
        raise
    finally:
        results.close()
    print(f'{results.path / "results.csv"}: {campaign.told()}')
    return 1 if campaign.failed else 0
