"""Fills the generated sections of the documents in docs/ anew; the tests hold them to it.

A section stands between a marker and `<!-- end -->`. After `<!-- $ snca ... -->` it holds what that
command prints in the root of the repository, after `<!-- table NAME -->` what `declared_tables`
makes from the declarations in the source.
"""

import contextlib
import io
import os
import re
import shlex
from pathlib import Path

from docs.declared_tables import TABLES
from snca_ros import cli
from snca_ros.files import write_text

DOCS = Path(__file__).parent
SECTION = re.compile(
    r'(<!-- (?:\$ snca (?P<command>.+?)|table (?P<table>.+?)) -->\n).*?(<!-- end -->)', re.DOTALL
)


def refreshed(text: str) -> str:
    """Return a document with its sections made anew.

    Raises:
        RuntimeError: a command fails.
        KeyError: there is no such table.
    """
    return SECTION.sub(_section, text)


def _section(found: re.Match) -> str:
    text = TABLES[found['table']]() if found['table'] else _output(found['command'])
    return f'{found[1]}\n{text}\n{found[4]}'


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
