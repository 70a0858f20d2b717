"""The options for workers of the commands `evolve`, `campaign` and `assess`."""

import argparse
from contextlib import AbstractContextManager
from dataclasses import dataclass

from sim_node.model.constants import Checked, constant, declaration
from snca_ros.commands.declared_options import add_option
from snca_ros.evolution.processors import available_processors
from snca_ros.evolution.workers import Workers, cluster_workers, local_workers


@dataclass(frozen=True)
class WorkerOptions(Checked):
    """Options of workers on this machine."""

    workers: int = constant(available_processors(), 1, 10_000, 'number of worker processes')


def add_worker_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the options that `open_workers` needs."""
    text = declaration(WorkerOptions, 'workers').metadata['text']
    add_option(parser, WorkerOptions, 'workers',
               help=f'{text} (default: one per processor that this process may use)')
    parser.add_argument('--scheduler', metavar='ADDRESS',
                        help='use the workers of this Dask scheduler, such as tcp://HOST:8786')


def open_workers(args: argparse.Namespace) -> AbstractContextManager[Workers]:
    """Return the workers of the command line, as a context manager."""
    if args.scheduler is None:
        return local_workers(args.workers)
    return cluster_workers(args.scheduler)


def check_workers(args: argparse.Namespace) -> None:
    """Check that the scheduler of the command line has workers, before a folder is made.

    Raises:
        InvalidInput: it has none, or does not answer.
    """
    if args.scheduler is not None:
        with cluster_workers(args.scheduler):
            pass
