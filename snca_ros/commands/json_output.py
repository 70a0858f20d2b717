"""The option `--json` of commands that print results."""

import argparse
import contextlib
import json
import math
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from sim_node.errors import InvalidInput, of_python
from snca_ros.files import check_writable, write_text

STANDARD_OUTPUT = '-'


def add_json_option(parser: argparse.ArgumentParser) -> None:
    """Declare the option of a command that calls `args.write_json` with its results."""
    parser.add_argument('--json', metavar='FILE', help='write the results as JSON, too; - for '
                        'standard output, while all text goes to standard error')


@contextlib.contextmanager
def json_output(path: str | None) -> Iterator[Callable[[Any], None]]:
    """Provide a function that writes the results of a command as JSON.

    Args:
        path: value of the option: a file, '-' for standard output, or None to write nothing. With
            '-', what the command prints goes to standard error, so that the output is only JSON.

    Raises:
        InvalidInput: the file cannot be written.
    """
    if path is None:
        yield lambda results: None
    elif path == STANDARD_OUTPUT:
        output = sys.stdout
        with contextlib.redirect_stdout(sys.stderr):
            yield lambda results: print(json_text(results), end='', file=output, flush=True)
    else:
        check_writable('json', Path(path))
        yield lambda results: _write(Path(path), results)


def _write(path: Path, results: Any) -> None:
    try:
        write_text(path, json_text(results))
    except OSError as error:
        shown = f'{path}: {error.strerror}'
        raise InvalidInput('json', shown, 'a file that can be written') from None


def json_text(results: Any) -> str:
    """Return results as JSON; numbers that are not finite, which JSON does not have, are null."""
    return json.dumps(_for_json(results), indent=2, allow_nan=False) + '\n'


def _for_json(value: Any) -> Any:
    value = of_python(value)
    if isinstance(value, dict):
        return {of_python(key): _for_json(one) for key, one in value.items()}
    if isinstance(value, (list, tuple)):
        return [_for_json(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
