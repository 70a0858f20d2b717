"""Files appear whole or not at all, whatever happens while they are written."""

import errno
import fcntl
import os
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from support.limits import LIMIT

import snca_ros.files
from sim_node.errors import InvalidInput
from snca_ros.files import (
    check_new_bag,
    check_writable,
    hold_folder,
    is_temporary,
    remove_stale,
    short_name,
    write_atomically,
    write_text,
)

ROOT = Path(snca_ros.__file__).parents[1]

WRITER = """
import os
import signal
import sys
from pathlib import Path
from snca_ros.files import write_text

# A shell without job control starts its background jobs with SIGINT ignored.
signal.signal(signal.SIGINT, signal.default_int_handler)

def wait(descriptor):
    print('written', flush=True)
    sys.stdin.read()  # ends only by a signal

os.fsync = wait
write_text(Path(sys.argv[1]), 'new')
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


@pytest.fixture
def umask():
    """Return a function that sets the umask, which is reset afterwards."""
    before = os.umask(0o022)
    yield os.umask
    os.umask(before)


@pytest.mark.parametrize(('mask', 'mode'), [(0o022, 0o644), (0o077, 0o600), (0o002, 0o664)])
def test_umask_gives_the_mode_of_a_new_file_and_an_old_one_keeps_its_own(
    tmp_path, umask, mask, mode
):
    umask(mask)
    new, old = tmp_path / 'new', tmp_path / 'old'
    old.write_text('old')
    old.chmod(0o640)
    for path, expected in ((new, mode), (old, 0o640)):
        write_text(path, 'x')
        assert stat.S_IMODE(path.stat().st_mode) == expected


def test_links_are_followed_to_their_target(tmp_path):
    (tmp_path / 'far').mkdir()
    target = tmp_path / 'far' / 'file'
    target.write_text('old')
    (tmp_path / 'near').symlink_to('far/file')
    (tmp_path / 'link').symlink_to('near')
    (tmp_path / 'dangling').symlink_to('far/new')
    (tmp_path / 'loop').symlink_to('loop')
    check_writable('csv', tmp_path / 'link')
    write_text(tmp_path / 'link', 'new')
    write_text(tmp_path / 'dangling', 'new')
    with pytest.raises(OSError, match=r'symbolic links.*loop'):
        write_text(tmp_path / 'loop', 'new')
    assert all((tmp_path / name).is_symlink() for name in ('near', 'link', 'dangling', 'loop'))
    assert names(tmp_path / 'far') == ['file', 'new']
    assert target.read_text() == (tmp_path / 'far' / 'new').read_text() == 'new'


def test_what_is_no_regular_file_is_written_into(tmp_path):
    fifo, got = tmp_path / 'fifo', []
    os.mkfifo(fifo)
    check_writable('csv', fifo)  # which must not wait for a reader
    reader = threading.Thread(target=lambda: got.append(fifo.read_bytes()))
    reader.start()
    write_text(fifo, 'through the pipe')
    reader.join()
    assert got == [b'through the pipe']
    assert stat.S_ISFIFO(fifo.stat().st_mode)
    (tmp_path / 'null').symlink_to('/dev/null')
    write_text(tmp_path / 'null', 'x')
    write_text(Path('/dev/null'), 'x')
    (tmp_path / 'full').symlink_to('/dev/full')
    with pytest.raises(OSError, match=r'No space left on device.*full'):
        write_text(tmp_path / 'full', 'x')
    assert names(tmp_path) == ['fifo', 'full', 'null']


@pytest.mark.skipif(os.geteuid() != 0, reason='only root may make devices')
def test_device_is_written_into_and_the_owner_is_kept(tmp_path):
    null, mine = tmp_path / 'null', tmp_path / 'file'
    try:
        os.mknod(null, stat.S_IFCHR | 0o666, os.makedev(1, 3))
    except PermissionError:
        pytest.skip('this container may not make devices')
    write_text(null, 'x')
    assert stat.S_ISCHR(null.lstat().st_mode)
    mine.write_text('old')
    os.chown(mine, 1234, 2345)
    write_text(mine, 'new')
    assert (mine.stat().st_uid, mine.stat().st_gid) == (1234, 2345)


def test_own_descriptor_is_written_at_its_place(tmp_path):
    with (tmp_path / 'out').open('w+b', buffering=0) as out:
        for path in (f'/proc/self/fd/{out.fileno()}', f'/dev/fd/{out.fileno()}'):
            (tmp_path / 'link').unlink(missing_ok=True)
            (tmp_path / 'link').symlink_to(path)
            check_writable('csv', tmp_path / 'link')
            out.write(b'before, ')
            write_text(tmp_path / 'link', 'between, ')
            write_text(Path(path), 'after\n')
    assert (tmp_path / 'out').read_text() == 2 * 'before, between, after\n'


@pytest.mark.skipif(os.geteuid() == 0, reason='root may write everywhere')
def test_file_that_may_not_be_written_is_kept(tmp_path):
    path = tmp_path / 'file'
    path.write_text('old')
    path.chmod(0o444)
    with pytest.raises(InvalidInput, match='Permission denied'):
        check_writable('csv', path)
    with pytest.raises(PermissionError, match='file'):
        write_text(path, 'new')
    assert path.read_text() == 'old'


def test_any_name_that_a_file_may_have_can_be_written(tmp_path):
    for name in ('x' * 255, 'é' * 127, '[*]?'):
        write_text(tmp_path / name, 'x')
    assert len(names(tmp_path)) == 3


def test_only_own_temporary_files_are_removed(tmp_path):
    own = '.table.csv.snca-0123456789abcdef.tmp'
    others = ['.table.csv.tmp', '.table.csv.ab12cd.tmp', '.table.csv.snca-0123.tmp',
              '.other.csv.snca-0123456789abcdef.tmp', 'table.csv.snca-0123456789abcdef.tmp']
    (tmp_path / 'in').mkdir()
    for name in (own, *others, f'in/{own}', f'in/{others[1]}'):
        (tmp_path / name).touch()
    (tmp_path / '.a.snca-0123456789abcdef.tmp').symlink_to(others[0])
    remove_stale(tmp_path, ['table.csv', 'a'])
    assert names(tmp_path) == sorted([*others, 'in', '.a.snca-0123456789abcdef.tmp'])
    remove_stale(tmp_path, ['in/*.csv'])
    assert names(tmp_path / 'in') == [others[1]]


def test_names_are_short_and_different():
    assert short_name('worm-seed1', 200) == 'worm-seed1'
    long = [f'{"é" * 300}-seed{n}' for n in range(100)]
    short = {short_name(name, 200) for name in long}
    assert len(short) == 100
    assert max(len(name.encode()) for name in short) <= 200


def test_text_is_utf_8(tmp_path):
    write_text(tmp_path / 'a.txt', 'ψ⁰ = 0\n')
    assert (tmp_path / 'a.txt').read_bytes() == 'ψ⁰ = 0\n'.encode()


def test_what_can_be_written_is_known_before(tmp_path):
    check_writable('csv', tmp_path / 'new.csv')
    assert names(tmp_path) == []
    for path in (tmp_path, tmp_path / 'nowhere' / 'new.csv', tmp_path / ('x' * 256)):
        with pytest.raises(InvalidInput, match=f'{path.name}: csv: got'):
            check_writable('csv', path)


def test_folder_of_a_bag_that_cannot_be_created_is_known_before(tmp_path):
    (tmp_path / 'file').touch()
    for path in (tmp_path / ('x' * 256), tmp_path / 'file' / 'bag'):
        with pytest.raises(InvalidInput, match='a folder that can be written'):
            check_new_bag(path, 'mcap')


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


@pytest.mark.parametrize('call', ['fsync', 'replace'])
@pytest.mark.parametrize('old', [None, b'the old content'])
def test_full_disk_leaves_the_folder_as_it_was(tmp_path, monkeypatch, call, old):
    path = tmp_path / 'file.bin'
    if old is not None:
        path.write_bytes(old)

    def fail(*args):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(snca_ros.files.os, call, fail)
    with pytest.raises(OSError, match=r'No space left.*file\.bin'):
        write_atomically(path, lambda file: file.write(b'new'))
    assert names(tmp_path) == ([] if old is None else ['file.bin'])
    assert old is None or path.read_bytes() == old


def test_no_folder_is_an_error_and_none_is_made(tmp_path):
    with pytest.raises(FileNotFoundError, match=r'missing/file\.txt'):
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
        assert writer.stdout.readline() == b'written\n'
        assert path.read_bytes() == b'the old content'
        writer.send_signal(end)
        assert writer.wait(LIMIT) != 0
    assert path.read_bytes() == b'the old content'
    left = [name for name in names(tmp_path) if name != 'file.bin']
    if end == signal.SIGINT:  # a signal that Python sees
        assert left == []
    # Nobody can clean up after SIGKILL; what it leaves is hidden and named as temporary.
    assert all(is_temporary(tmp_path / name) for name in left)
    remove_stale(tmp_path, ['file.bin'])
    assert names(tmp_path) == ['file.bin']


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
