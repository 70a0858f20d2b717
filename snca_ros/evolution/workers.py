"""Workers: `concurrent.futures` executors in this process, on this machine or on a cluster."""

import contextlib
import multiprocessing
import multiprocessing.connection
import os
import signal
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ProcessPoolExecutor
from concurrent.futures import CancelledError as FutureCancelled
from dataclasses import dataclass
from typing import Any

from sim_node.errors import InvalidInput

_ANSWER_LIMIT = 60.0  # s, for a scheduler and its first worker


@dataclass(frozen=True)
class Workers:
    """An executor, and a function that returns how many tasks it can run at a time now."""

    executor: Executor
    count: Callable[[], int]


class _InProcess(Executor):
    """Runs each task in this process, when it is submitted."""

    def submit(self, task: Callable, /, *args: Any, **kwargs: Any) -> Future:
        future: Future = Future()
        try:
            future.set_result(task(*args, **kwargs))
        except Exception as error:
            future.set_exception(error)
        return future


IN_PROCESS = Workers(_InProcess(), lambda: 1)
"""Workers that use no other process."""


class _LocalProcesses(ProcessPoolExecutor):
    def __init__(self, n: int) -> None:
        with _safe_path():
            super().__init__(n, multiprocessing.get_context('spawn'), _start_worker)

    def submit(self, task: Callable, /, *args: Any, **kwargs: Any) -> Future:
        # A worker that is starting must not receive Ctrl-C.
        with _interrupts_blocked(), _safe_path():
            return super().submit(task, *args, **kwargs)

    def kill(self) -> None:
        for process in list((self._processes or {}).values()):
            process.kill()


@contextlib.contextmanager
def local_workers(n: int) -> Iterator[Workers]:
    """Provide `n` worker processes on this machine; an error in the block kills them."""
    executor = _LocalProcesses(n)
    try:
        yield Workers(executor, lambda: n)
    except BaseException:
        executor.kill()
        raise
    finally:
        executor.shutdown(wait=True, cancel_futures=True)


def _start_worker() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    """End this worker process when its parent process has ended, even if it was killed."""
    parent = multiprocessing.parent_process()
    if parent is not None:
        multiprocessing.connection.wait([parent.sentinel])
        os._exit(1)


@contextlib.contextmanager
def _safe_path() -> Iterator[None]:
    """Let new processes not import modules, such as a socket.py, from the working directory.

    They get the import path of this process afterwards. Python before 3.11 ignores the variable.
    """
    name, old = 'PYTHONSAFEPATH', os.environ.get('PYTHONSAFEPATH')
    os.environ[name] = '1'
    try:
        yield
    finally:
        if old is None:
            del os.environ[name]
        else:
            os.environ[name] = old


@contextlib.contextmanager
def _interrupts_blocked() -> Iterator[None]:
    old = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, old)


@contextlib.contextmanager
def cluster_workers(address: str) -> Iterator[Workers]:
    """Provide the workers of the Dask scheduler at `address`, which may join and leave at any time.

    Raises:
        InvalidInput: the extra `cluster` is not installed, the scheduler does not answer, or it has
            no worker.
        BrokenExecutor: the scheduler is lost, or a task has ended several workers.
    """
    try:
        from distributed import CancelledError, Client, KilledWorker
    except ImportError:
        expected = "an installation with Dask: pip install 'snca_ros[cluster]'"
        raise InvalidInput('scheduler', address, expected) from None

    class Connection(Client):
        """A client that closes itself here if it cannot connect.

        Else its finaliser does, in any thread, where it can wait for itself for ever.
        """

        def __init__(self) -> None:
            try:
                super().__init__(address, timeout=_ANSWER_LIMIT)
                self.wait_for_workers(1, timeout=_ANSWER_LIMIT)
            except BaseException:
                with contextlib.suppress(AttributeError):  # it failed before it had a loop
                    self.close()
                raise

    try:
        client = Connection()
    except (OSError, ValueError) as error:
        expected = f'the address of a Dask scheduler with workers ({error})'
        raise InvalidInput('scheduler', address, expected) from None
    executor = client.get_executor(pure=False)

    def count() -> int:
        try:
            return max(1, sum(client.nthreads().values()))
        except OSError as error:
            raise BrokenExecutor(f'{address}: {error}') from error

    try:
        yield Workers(executor, count)
    except (CancelledError, FutureCancelled, KilledWorker) as error:
        raise BrokenExecutor(f'{address}: {error}') from error
    finally:
        executor.shutdown(wait=False)
        client.close()
