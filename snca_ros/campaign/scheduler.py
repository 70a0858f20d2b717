"""The scheduler of a campaign, which evolves and assesses many runs in parallel."""

from collections import deque
from collections.abc import Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Future, wait
from concurrent.futures.process import BrokenProcessPool
from pathlib import Path

from snca_ros.campaign.endpoints import Outcome, perform
from snca_ros.campaign.results import Results
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.workers import Workers
from snca_ros.progress import TimeLeft

_PROGRESS_PERIOD = 1.0  # s


class Listener:
    """Receives the events of a campaign; the methods of this base class do nothing."""

    def progress(self, campaign: 'Campaign') -> None:
        """Receive the campaign, about once a second."""

    def finished(self, outcome: Outcome) -> None:
        """Receive the results of a run that has finished."""

    def failed(self, run: str, reason: str) -> None:
        """Receive the name of a run that has failed, and the reason."""


class Campaign:
    """The runs of a campaign: waiting, running, failed, or finished and in the results.

    Args:
        configs: configurations of the runs, in the order in which they start.
        results: results folder, which has the rows of finished runs.
        runs: folder of the run folders, the same on all workers.
        listener: called for each run that ends, and every second with the progress.
    """

    def __init__(
        self, configs: Sequence[RunConfig], results: Results, runs: Path,
        listener: Listener | None = None,
    ) -> None:
        self.configs, self.results, self.runs = configs, results, runs
        self.waiting = deque(c for c in configs if c.name not in results.rows)
        self.running: dict[Future[Outcome], RunConfig] = {}
        self.failed: dict[str, str] = {}
        self._suspects: set[str] = set()  # names of runs, one of which ended its worker process
        self._at_once = 1  # number of suspects that run at a time
        self._listener = listener or Listener()
        self._left = TimeLeft(sum(c.episodes for c in configs), self._episodes())

    def work(self, workers: Workers) -> None:
        """Perform the waiting runs, as many at a time as there are workers.

        When a local worker process ends, it is not known which run was the cause. All runs that
        were running are tried again, half as many at a time, until a run ends its process while it
        is the only one: this run has failed.

        Raises:
            BrokenExecutor, CancelledError: a worker process ended, or the cluster is lost; the runs
                that were running are waiting again, or have failed.
        """
        try:
            while self.waiting or self.running:
                most = self._at_once if self._suspects else workers.count()
                while self.waiting and len(self.running) < most:
                    config = self.waiting[0]
                    future = workers.executor.submit(perform, config, self.runs / config.name)
                    self.running[future] = self.waiting.popleft()
                done, _ = wait(self.running, _PROGRESS_PERIOD, FIRST_COMPLETED)
                for future in done:
                    self._finish(future)
                self._listener.progress(self)
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
        self._listener.finished(outcome)

    def _put_back(self, a_process_ended: bool) -> None:
        configs = list(self.running.values())
        self.running.clear()
        if a_process_ended and len(configs) == 1 and configs[0].name in self._suspects:
            self._fail(configs[0], 'it alone was running when a process ended (out of memory?)')
            self._suspects.clear()
            return
        self.waiting.extendleft(reversed(configs))
        if a_process_ended:
            self._suspects.update(config.name for config in configs)
            self._at_once = max(1, len(configs) // 2)

    def _fail(self, config: RunConfig, reason: str) -> None:
        self.failed[config.name] = reason
        self._suspects.discard(config.name)
        self._listener.failed(config.name, reason)

    def _episodes(self) -> int:
        """Return the number of episodes spent so far, from the histories in the run folders."""
        return sum(
            c.episodes if c.name in self.results.rows else _spent(self.runs / c.name)
            for c in self.configs
        )

    def describe(self) -> str:
        """Return the numbers of finished, running, waiting and failed runs and the time left."""
        done = sum(c.name in self.results.rows for c in self.configs)
        text = (
            f'{done} of {len(self.configs)} runs done, {len(self.running)} running, '
            f'{len(self.waiting)} waiting, {len(self.failed)} failed'
        )
        if not (self.waiting or self.running):
            return text
        return f'{text}; episodes {self._left.describe(self._episodes())}'


def _spent(folder: Path) -> int:
    try:
        return int((folder / 'history.csv').read_text().splitlines()[-1].split(',')[1])
    except (OSError, ValueError, IndexError):  # none yet
        return 0
