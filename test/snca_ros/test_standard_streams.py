"""Printing works on streams of any encoding, on closed ones, and on those that nobody reads."""

import io
import os
import subprocess
import sys

import pytest
from support.limits import LIMIT
from support.paths import ROOT

from snca_ros.command_line import exit_code
from snca_ros.standard_streams import prepare_streams


@pytest.mark.parametrize(('encoding', 'shown'), [
    ('ascii', '0.5 +/- 0.1 -> _# 3x4... a\\udcff'),
    ('latin-1', '0.5 ± 0.1 -> _# 3×4... a\\udcff'),
    ('utf-8', '0.5 ± 0.1 → ▁█ 3×4… a\\udcff'),
])
def test_a_stream_replaces_what_it_cannot_encode(encoding, shown, monkeypatch):
    stream = io.TextIOWrapper(io.BytesIO(), encoding)
    monkeypatch.setattr('sys.stdout', stream)
    prepare_streams()
    print('0.5 ± 0.1 → ▁█ 3×4… a\udcff', flush=True)
    assert stream.buffer.getvalue().decode(encoding) == f'{shown}\n'


def test_closed_streams_are_not_taken_by_files():
    program = """
import sys, os
from snca_ros import cli
code = cli.main(['wlak'])  # would write its error into the next file that is opened
with open('/dev/null') as file:
    assert file.fileno() > 2
    os.write(2, b'written by a library')
assert cli.main(['--version']) == 0
os._exit(code)
"""
    run = subprocess.run(
        ['sh', '-c', 'exec "$0" -c "$1" <&- >&- 2>&-', sys.executable, program],
        env={**os.environ, 'PYTHONPATH': str(ROOT)}, timeout=LIMIT, check=False,
    )
    assert run.returncode == 2


def test_an_error_is_not_printed_on_standard_output_if_standard_error_is_closed():
    run = subprocess.run(
        ['sh', '-c', 'exec "$0" -m snca_ros wlak 2>&-', sys.executable],
        env={**os.environ, 'PYTHONPATH': str(ROOT)}, timeout=LIMIT, check=False,
        capture_output=True, text=True,
    )
    assert (run.returncode, run.stdout) == (2, '')


@pytest.mark.parametrize('stream', ['stdout', 'stderr'])
def test_a_full_disk_is_no_traceback(stream, monkeypatch, capfd):
    with open('/dev/full', 'w') as full:
        monkeypatch.setattr(f'sys.{stream}', full)

        def run():
            print('x', file=getattr(sys, stream))
            return 0

        code = exit_code('test', run)
    out, err = capfd.readouterr()
    assert out == ''
    assert code == (1 if stream == 'stdout' else 0)
    assert err.count('\n') == (1 if stream == 'stdout' else 0)


@pytest.mark.parametrize('name', ['walk', 'voxel_node'])
def test_a_reader_of_the_help_may_go_early(name):
    reader, writer = os.pipe()
    os.close(reader)
    run = subprocess.run(
        [sys.executable, '-m', 'snca_ros', name, '--help'], stdout=writer, stderr=subprocess.PIPE,
        env={**os.environ, 'PYTHONPATH': str(ROOT)}, timeout=LIMIT, check=False, text=True,
    )
    os.close(writer)
    assert run.stderr == ''
