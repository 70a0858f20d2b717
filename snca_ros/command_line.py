"""Command lines of commands and nodes: parsing options, importing modules, exit codes."""

import argparse
import importlib
import sys
from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor
from types import ModuleType
from typing import Any, NoReturn

from sim_node.errors import InvalidInput, near_miss
from snca_ros.interrupts import INTERRUPTED
from snca_ros.standard_streams import discard_unwritable, write_error

BAD_INPUT = 2
"""The exit code after invalid input."""


class FormerlyWithValue(argparse.Action):
    """A flag that took an optional value in earlier versions, which now has an option of its own.

    argparse cannot distinguish such a value from a positional argument. A value is still accepted,
    with a warning, if it looks like one.

    Attributes:
        own_option: the option of the value, which implies the flag.
        is_value: returns whether the argument after the flag looks like a value.
    """

    def __init__(
        self, *, own_option: str, is_value: Callable[[str], bool], **options: Any
    ) -> None:
        super().__init__(nargs=0, default=False, **options)
        self.own_option, self.is_value = own_option, is_value

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, *_: object
    ) -> None:
        """Set the flag."""
        setattr(namespace, self.dest, True)


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
        parsed, unknown = self.parse_known_args(self._present_spelling(args), namespace)
        if unknown:
            known = [name for action in self._actions if action.help != argparse.SUPPRESS
                     for name in action.option_strings]
            hint = near_miss(unknown[0].partition('=')[0], known)
            self.error(f'unknown argument {unknown[0]!r}{hint}')
        return parsed

    def _present_spelling(self, args: Sequence[str] | None) -> list[str]:
        """Return arguments in which values of former options follow their own options."""
        left, found = list(sys.argv[1:] if args is None else args), []
        former = {
            option: action for action in self._actions if isinstance(action, FormerlyWithValue)
            for option in action.option_strings
        }
        while left and left[0] != '--':
            name, joined, value = left.pop(0).partition('=')
            found.append(f'{name}{joined}{value}')
            action = former.get(name)
            if action is None:
                continue
            if not joined and not (left and action.is_value(left[0])):
                continue
            value = value if joined else left.pop(0)
            found[-1:] = [f'{action.own_option}={value}']
            write_error(
                f'{self.prog}: warning: {name} takes no value any more; use {action.own_option} '
                f'{value}'
            )
        return [*found, *left]

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
        code = run()
        sys.stdout.flush()
        return code
    except InvalidInput as error:
        write_error(f'snca {name}: error: {error}')
        return BAD_INPUT
    except KeyboardInterrupt:
        return INTERRUPTED
    except BrokenPipeError:  # the reader of the output has ended
        return 1
    except (BrokenExecutor, OSError) as error:  # a killed worker; a full disk, a folder gone
        write_error(f'snca {name}: error: {error}')
        return 1
    finally:
        discard_unwritable()


def load_module(name: str) -> ModuleType:
    """Return the module `name`; InvalidInput if it needs ROS and ROS is not installed."""
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if (error.name or '').partition('.')[0] != 'rclpy':
            raise
        expected = "rclpy: pip install 'snca_ros[ros]', or source the setup file of ROS 2 Jazzy"
        raise InvalidInput('ROS 2', None, expected) from None
