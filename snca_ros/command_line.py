"""The parser of a sub-command: help with examples, and errors of one line with a near miss."""

import argparse
from collections.abc import Sequence
from types import ModuleType
from typing import Any, NoReturn

from sim_node.errors import near_miss


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
        self.exit(2, f'{self.prog}: error: {message}; {self.prog} --help tells all\n')
