"""Command lines of commands and nodes: parsing options, importing modules, exit codes."""

import argparse
import importlib
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import contextmanager
from types import ModuleType
from typing import Any, NoReturn

from sim_node.errors import InvalidInput, near_miss

BAD_INPUT = 2
"""The exit code after invalid input."""

INTERRUPTED = 130
"""The exit code after Ctrl-C."""


class CommandParser(argparse.ArgumentParser):
    """Parses the options of a sub-command of `snca`.

    Args:
        name: name of the sub-command.
        text: description of the sub-command.
        module: its module: `add_arguments(parser)` declares the options, and the help ends with
            `EXAMPLES`.
    """

    def __init__(self, name: str, text: str, module: ModuleType) -> None:
        super().__init__(
            prog=f'snca {name}', description=f'{text[0].upper()}{text[1:]}.',
            epilog='examples:' + module.EXAMPLES.rstrip(),
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        module.add_arguments(self)

    def parse_args(  # type: ignore[override]  # one signature for argparse's three
        self, args: Sequence[str] | None = None, namespace: Any = None
    ) -> Any:
        """Return the values of the options; end the process if an argument is unknown."""
        parsed, unknown = self.parse_known_args(args, namespace)
        if unknown:
            known = [name for action in self._actions for name in action.option_strings]
            hint = near_miss(unknown[0].partition('=')[0], known)
            self.error(f'unknown argument {unknown[0]!r}{hint}')
        return parsed

    def error(self, message: str) -> NoReturn:
        """End the process with an error of one line."""
        self.exit(BAD_INPUT, f'{self.prog}: error: {message}; see {self.prog} --help\n')


def exit_code(name: str, run: Callable[[], int]) -> int:
    """Call `run` and return its exit code; print errors of the user or the system as one line.

    Args:
        name: name of the command or node, for the error.
        run: returns the exit code.
    """
    try:
        return run()
    except InvalidInput as error:
        print(f'snca {name}: error: {error}', file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # the reader has ended; discard the rest of the output
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (BrokenExecutor, OSError) as error:  # a killed worker; a full disk, a folder gone
        print(f'snca {name}: error: {error}', file=sys.stderr)
        return 1


@contextmanager
def exiting_at_interrupt() -> Iterator[None]:
    """End the process at Ctrl-C at once in this block, whose code has nothing to finish.

    For imports and compiled code: a KeyboardInterrupt that is raised in one of their callbacks and
    finalisers would be ignored.
    """
    before = signal.getsignal(signal.SIGINT)
    if before is not signal.default_int_handler:  # ignored by a shell's background jobs
        yield
        return
    signal.signal(signal.SIGINT, lambda number, frame: os._exit(INTERRUPTED))
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def load_module(name: str) -> ModuleType:
    """Return the module `name`; InvalidInput if it needs ROS and ROS is not installed."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if (error.name or '').partition('.')[0] != 'rclpy':
            raise
        expected = "rclpy: pip install 'snca_ros[ros]', or source the setup file of ROS 2 Jazzy"
        raise InvalidInput('ROS 2', None, expected) from None
