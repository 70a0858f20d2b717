"""Options of commands that are declared constants: default, check and help of the declaration."""

import argparse
from collections.abc import Sequence
from typing import Any

from sim_node.model.constants import declaration, help_of, value_of


class DeclaredOption(argparse.Action):
    """Stores the value of an option, checked as the field `declared` says.

    Attributes:
        declared: the field.
    """

    def __init__(self, declared: Any, **options: Any) -> None:
        super().__init__(**options)
        self.declared = declared

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace,
        values: str | Sequence[Any] | None, option_string: str | None = None,
    ) -> None:
        """Check and store a value; InvalidInput names the option, the value and the range."""
        if isinstance(values, str):  # else what stands for an option without a value
            values = value_of(self.option_strings[0], values, self.declared)
        setattr(namespace, self.dest, values)


def add_option(
    parser: argparse.ArgumentParser | argparse._ArgumentGroup, kind: type, name: str,
    flag: str = '', **options: Any,
) -> None:
    """Declare an option whose value is a declared field of a dataclass.

    A value that is off is refused as `InvalidInput` that names the option, the value and what is
    expected.

    Args:
        parser: of the command, or a group of its options.
        kind: the dataclass.
        name: of the field.
        flag: the option; --name if empty.
        options: of `add_argument`; without them default and help are those of the declaration.
    """
    f = declaration(kind, name)
    options = {'default': f.default, 'help': help_of(kind, name), **options}
    option = flag or f'--{name.replace("_", "-")}'
    parser.add_argument(option, action=DeclaredOption, declared=f, **options)
