"""Fills the generated sections of the documents in docs/ anew; the tests hold them to it.

A section stands between `<!-- $ snca ... -->` and `<!-- end -->`, and holds what that command
prints in the root of the repository.
"""

import contextlib
import io
import os
import re
import shlex
from pathlib import Path

from snca_ros import cli
from snca_ros.files import write_text

DOCS = Path(__file__).parent
_SECTION = re.compile(r'(<!-- \$ snca (.+?) -->\n).*?(<!-- end -->)', re.DOTALL)


def refreshed(text: str) -> str:
    """Return a document with the output of its commands in its sections.

    Raises:
        RuntimeError: a command fails.
    """
    return _SECTION.sub(lambda found: f'{found[1]}\n{_output(found[2])}\n{found[3]}', text)


def _output(command: str) -> str:
    out = io.StringIO()
    with contextlib.redirect_stdout(out):
        code = cli.main(shlex.split(command))
    if code:
        raise RuntimeError(f'snca {command}: exit code {code}')
    return out.getvalue()


if __name__ == '__main__':
    os.chdir(DOCS.parent)
    for path in sorted(DOCS.glob('*.md')):
        write_text(path, refreshed(path.read_text()))
