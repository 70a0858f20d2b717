"""Files appear whole or not at all, whatever happens while they are written."""

import errno
import fcntl
import os
import signal
import stat
import subprocess
import sys
from pathlib import Path

import pytest

import snca_ros.files
from sim_node.errors import InvalidInput
from snca_ros.files import (
    check_new_bag,
    check_writable,
    hold_folder,
    write_atomically,
    write_text,
)

ROOT = Path(snca_ros.__file__).parents[1]
LIMIT = 120.0  # s; only a hang reaches it

WRITER = """
import signal
import sys
from pathlib import Path
from snca_ros.files import write_atomically

# A shell without job control starts its background jobs with SIGINT ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)

def write(file):
    file.write(b'half of')
    file.flush()
    print('half', flush=True)
    sys.stdin.read()  # ends only by a signal

write_atomically(Path(sys.argv[1]), write)
"""


def names(folder: Path) -> list[str]:
    return sorted(p.name for p in folder.iterdir())


@pytest.mark.parametrize('old', [None, b'the old content'])
def test_file_is_created_or_replaced(tmp_path, old):
    path = tmp_path / 'file.bin'
    if old is not None:
        path.write_bytes(old)
    write_atomically(path, lambda file: file.write(b'new\x00\xff'))
    assert path.read_bytes() == b'new\x00\xff'
    assert names(tmp_path) == ['file.bin']
    assert stat.S_IMODE(path.stat().st_mode) == 0o644


def test_text_is_utf_8(tmp_path):
    write_text(tmp_path / 'a.txt', 'ψ⁰ = 0\n')
    assert (tmp_path / 'a.txt').read_bytes() == 'ψ⁰ = 0\n'.encode()


def test_what_can_be_written_is_known_before(tmp_path):
    check_writable('csv', tmp_path / 'new.csv')
    assert names(tmp_path) == []
    for path in (tmp_path, tmp_path / 'nowhere' / 'new.csv'):
        with pytest.raises(InvalidInput, match=f'{path.name}: csv: got'):
            check_writable('csv', path)


def test_readers_of_the_old_file_keep_it(tmp_path):
    path = tmp_path / 'file.bin'
    path.write_bytes(b'old')
    with path.open('rb') as reader:
        write_atomically(path, lambda file: file.write(b'new'))
        assert reader.read() == b'old'
    assert path.read_bytes() == b'new'


def test_content_is_on_the_disk_before_it_gets_its_name(tmp_path, monkeypatch):
    calls = []
    fsync, replace = os.fsync, os.replace
    monkeypatch.setattr(os, 'fsync', lambda fd: calls.append('fsync') or fsync(fd))
    monkeypatch.setattr(os, 'replace', lambda *a: calls.append('replace') or replace(*a))
    write_atomically(tmp_path / 'file.bin', lambda file: file.write(b'x'))
    assert calls == ['fsync', 'replace']


@pytest.mark.parametrize('old', [None, b'the old content'])
@pytest.mark.parametrize('error', [ValueError, OSError, MemoryError, KeyboardInterrupt, SystemExit])
def test_error_while_writing_leaves_the_folder_as_it_was(tmp_path, error, old):
    path = tmp_path / 'file.bin'
    if old is not None:
        path.write_bytes(old)

    def write(file):
        file.write(b'half of')
        file.flush()
        raise error

    with pytest.raises(error):
        write_atomically(path, write)
    assert names(tmp_path) == ([] if old is None else ['file.bin'])
    assert old is None or path.read_bytes() == old


@pytest.mark.parametrize('call', ['fsync', 'chmod', 'replace'])
@pytest.mark.parametrize('old', [None, b'the old content'])
def test_full_disk_leaves_the_folder_as_it_was(tmp_path, monkeypatch, call, old):
    path = tmp_path / 'file.bin'
    if old is not None:
        path.write_bytes(old)

    def fail(*args):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(snca_ros.files.os, call, fail)
    with pytest.raises(OSError, match='No space left'):
        write_atomically(path, lambda file: file.write(b'new'))
    assert names(tmp_path) == ([] if old is None else ['file.bin'])
    assert old is None or path.read_bytes() == old


def test_no_folder_is_an_error_and_none_is_made(tmp_path):
    with pytest.raises(FileNotFoundError):
        write_text(tmp_path / 'missing' / 'file.txt', 'x')
    assert names(tmp_path) == []


@pytest.mark.parametrize('end', [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_signal_while_writing_leaves_the_old_file(tmp_path, end):
    path = tmp_path / 'file.bin'
    path.write_bytes(b'the old content')
    with subprocess.Popen(
        [sys.executable, '-c', WRITER, str(path)],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL,
        env={**os.environ, 'PYTHONPATH': str(ROOT)},
    ) as writer:
        assert writer.stdout.readline() == b'half\n'
        assert path.read_bytes() == b'the old content'
        writer.send_signal(end)
        assert writer.wait(LIMIT) != 0
    assert path.read_bytes() == b'the old content'
    left = [name for name in names(tmp_path) if name != 'file.bin']
    if end == signal.SIGINT:  # a signal that Python sees
        assert left == []
    # Nobody can clean up after SIGKILL; what it leaves is hidden and named as temporary.
    assert all(name.startswith('.file.bin.') and name.endswith('.tmp') for name in left)


def test_where_a_bag_cannot_be_made(tmp_path, monkeypatch):
    (tmp_path / 'file').write_bytes(b'')
    (tmp_path / 'there').mkdir()
    for name, reason in (
        ('there', 'does not exist yet'),
        ('file/bag', 'Not a directory'),
        ('/proc/nowhere/bag', 'can be written'),
    ):
        with pytest.raises(InvalidInput, match=reason):
            check_new_bag(tmp_path / name, 'mcap')
    check_new_bag(tmp_path / 'new' / 'bag', 'sqlite3')
    check_new_bag(tmp_path / 'a#%?', 'mcap')
    with pytest.raises(InvalidInput, match=r"a#b', expected a path without # % \?, or"):
        check_new_bag(tmp_path / 'a#b', 'sqlite3')
    monkeypatch.setattr(snca_ros.files, 'RESERVE', 10**18)
    with pytest.raises(InvalidInput, match='of free space'):
        check_new_bag(tmp_path / 'bag', 'mcap')
    assert names(tmp_path) == ['file', 'there']


def test_text_with_names_of_files_that_are_not_utf8_is_written_in_utf8(tmp_path):
    write_text(tmp_path / 'page.html', '→ a\udcff')
    assert (tmp_path / 'page.html').read_text(encoding='utf-8') == '→ a\\udcff'


@pytest.mark.parametrize(('number', 'in_use'), [
    (errno.EWOULDBLOCK, True), (errno.EACCES, True), (errno.ENOLCK, False), (errno.ENOSYS, False),
    (errno.EOPNOTSUPP, False),
])
def test_a_file_system_without_locks_is_not_a_folder_in_use(
    number, in_use, tmp_path, monkeypatch, capsys
):
    def flock(file, operation):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(fcntl, 'flock', flock)
    if in_use:
        with pytest.raises(InvalidInput, match='a folder in use'):
            hold_folder(tmp_path, 'run')
    else:
        hold_folder(tmp_path, 'run').close()
        assert capsys.readouterr().err == (
            f'warning: {tmp_path} cannot be locked ({os.strerror(number)}): make sure that no '
            'other process works on this folder\n'
        )
