"""The options that say where work is done, of the commands `evolve`, `campaign` and `assess`."""

import argparse
import os
from contextlib import AbstractContextManager

from snca_ros.evolution.workers import Workers, cluster_workers, local_workers


def add_worker_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options that `open_workers` needs."""
    parser.add_argument('--workers', type=int, default=os.cpu_count() or 1,
                        help='processes that evaluate (default: all cores)')
    parser.add_argument('--scheduler', metavar='ADDRESS',
                        help='use the workers of this Dask scheduler, as tcp://HOST:8786')


def open_workers(
    args: argparse.Namespace, parser: argparse.ArgumentParser
) -> AbstractContextManager[Workers]:
    """Return the workers that the command line asks for; a context manager."""
    if args.workers < 1:
        parser.error(f'--workers: got {args.workers}, expected at least 1')
    return cluster_workers(args.scheduler) if args.scheduler else local_workers(args.workers)
