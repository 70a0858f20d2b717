"""What all commands and nodes share: parsing options, loading their modules, ending on errors."""

import argparse
import importlib
import os
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor
from types import ModuleType
from typing import Any, NoReturn

from sim_node.errors import InvalidInput, near_miss

BAD_INPUT = 2
"""The exit code when what a person gave is wrong."""

INTERRUPTED = 130
"""The exit code after Ctrl-C."""


class CommandParser(argparse.ArgumentParser):
    """Parses the options of a sub-command of `snca`.

    Args:
        name: of the sub-command.
        text: what it does.
        module: declares the options by `add_arguments(parser)`; its `EXAMPLES` end the help.
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
        """Return the values of the options; what nobody has declared ends the process."""
        parsed, unknown = self.parse_known_args(args, namespace)
        if unknown:
            known = [name for action in self._actions for name in action.option_strings]
            hint = near_miss(unknown[0].partition('=')[0], known)
            self.error(f'unknown argument {unknown[0]!r}{hint}')
        return parsed

    def error(self, message: str) -> NoReturn:
        """End the process with one line."""
        self.exit(BAD_INPUT, f'{self.prog}: error: {message}; {self.prog} --help tells all\n')


def exit_code(name: str, run: Callable[[], int]) -> int:
    """Return the exit code of `run`; an error that a person can put right is one line.

    Args:
        name: of the command or node, for the error.
        run: returns the exit code.
    """
    try:
        return run()
    except InvalidInput as error:
        print(f'snca {name}: error: {error}', file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # nobody reads on; what is still in the buffer goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except (BrokenExecutor, OSError) as error:  # a killed worker; a full disk, a folder gone
        print(f'snca {name}: error: {error}', file=sys.stderr)
        return 1


def load_module(name: str) -> ModuleType:
    """Return the module `name`; InvalidInput if it needs ROS and there is none."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if (error.name or '').partition('.')[0] != 'rclpy':
            raise
        expected = "rclpy: pip install 'snca_ros[ros]', or source the setup file of ROS 2 Jazzy"
        raise InvalidInput('ROS 2', None, expected) from None
