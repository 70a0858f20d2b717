"""Worker processes for notebooks and scripts."""

import contextlib
import multiprocessing
from collections.abc import Iterator
from concurrent.futures import BrokenExecutor

from sim_node.errors import InvalidInput
from snca_ros.evolution.workers import IN_PROCESS, Workers, local_workers


@contextlib.contextmanager
def worker_processes(n: int) -> Iterator[Workers]:
    """Provide `n` worker processes on this machine; 1 is this process itself.

    Raises:
        InvalidInput: `n` is not an integer from 1.
        BrokenExecutor: a worker process ended unexpectedly.
    """
    if isinstance(n, bool) or not isinstance(n, int) or n < 1:
        raise InvalidInput('workers', n, 'an integer from 1')
    if n == 1:
        yield IN_PROCESS
        return
    if _is_starting():
        raise SystemExit(1)  # the parent process raises the error that explains it
    try:
        with local_workers(n) as workers:
            yield workers
    except BrokenExecutor as error:
        text = (
            'a worker process ended unexpectedly. Each worker imports the script that started it, '
            "so a script must do its work below `if __name__ == '__main__':`. If it does, there "
            'may be too little memory for so many workers. workers=1 needs no other process.'
        )
        raise BrokenExecutor(text) from error


def _is_starting() -> bool:
    """Return whether this process is a worker that is importing the script of its parent."""
    # multiprocessing sets this attribute, and checks it before it starts a process.
    return getattr(multiprocessing.current_process(), '_inheriting', False)
