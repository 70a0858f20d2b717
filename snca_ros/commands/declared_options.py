"""Options of commands that are declared fields, which define default, check and help text."""

import argparse
from collections.abc import Sequence
from typing import Any

from sim_node.model.constants import declaration, help_of, value_of
from snca_ros.standard_streams import write_error


class DeclaredOption(argparse.Action):
    """Checks the value of an option against a declared field and stores it.

    Attributes:
        declared: the declared field.
    """

    def __init__(self, declared: Any, **options: Any) -> None:
        super().__init__(**options)
        self.declared = declared

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace,
        values: str | Sequence[Any] | None, option_string: str | None = None,
    ) -> None:
        """Check and store a value; InvalidInput names the option, the value and the range."""
        if isinstance(values, str):  # else it is the value of `const`
            values = value_of(self.option_strings[0], values, self.declared)
        setattr(namespace, self.dest, values)


class RepeatedOption(DeclaredOption):
    """A declared text, whose parts are joined by semicolons if the option is repeated."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace,
        values: str | Sequence[Any] | None, option_string: str | None = None,
    ) -> None:
        """Check the value and join it to the former ones."""
        before = getattr(namespace, self.dest)
        super().__call__(parser, namespace, values, option_string)
        if before is not None:
            setattr(namespace, self.dest, f'{before};{values}')


class FormerOption(DeclaredOption):
    """The former name of a declared option, which still works, with a warning."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace,
        values: str | Sequence[Any] | None, option_string: str | None = None,
    ) -> None:
        """Warn, then check and store a value."""
        super().__call__(parser, namespace, values, option_string)
        present = f'--{self.dest.replace("_", "-")}'
        write_error(f'{parser.prog}: warning: {self.option_strings[0]} is now {present}')


def add_option(
    parser: argparse.ArgumentParser | argparse._ArgumentGroup, kind: type, name: str,
    flag: str = '', action: type[DeclaredOption] = DeclaredOption, **options: Any,
) -> None:
    """Add an option for a declared field of a dataclass.

    An invalid value raises `InvalidInput`, which names the option, the value and the expectation.

    Args:
        parser: parser of the command, or a group of its options.
        kind: the dataclass.
        name: name of the field.
        flag: the option; --name if empty.
        action: how a value is stored.
        options: arguments of `add_argument`; the defaults of `default` and `help` are those of the
            declaration.
    """
    f = declaration(kind, name)
    options = {'default': f.default, 'help': help_of(kind, name), **options}
    option = flag or f'--{name.replace("_", "-")}'
    parser.add_argument(option, action=action, declared=f, **options)
