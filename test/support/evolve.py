"""`snca evolve` as a process or in this one, and what its run folder holds."""

import csv
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
from support.limits import LIMIT
from support.processes import stat_of, wait_until

import snca_ros
from snca_ros import cli

ROOT = Path(snca_ros.__file__).parents[1]
TASK = (
    '--shape', 'worm', '--duration', '1', '--transient', '0.2', '--population', '8', '--seed', '3',
)
EVALUATIONS = 200
"""Of the whole run: 8, then 27 generations of 7, then 3 that remain."""
FILES = {'config.yaml', 'history.csv', 'checkpoint.npz', 'best.npz'}
VISIBLE = sorted(FILES)


def command(*arguments: object) -> list[str]:
    return [sys.executable, '-m', 'snca_ros', 'evolve', *map(str, arguments)]


def environment() -> dict[str, str]:
    return {**os.environ, 'PYTHONPATH': str(ROOT)}


def evolve(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess:
    """Run the command to its end."""
    return subprocess.run(
        command(*arguments), cwd=cwd, env=environment(),
        capture_output=True, text=True, timeout=LIMIT, check=False,
    )


def evaluations_in(folder: Path) -> int:
    try:
        rows = (folder / 'history.csv').read_text().splitlines()
    except FileNotFoundError:
        return 0
    return int(rows[-1].split(',')[1])


def freeze_midway(process: subprocess.Popen, folder: Path) -> int:
    """Stop (SIGSTOP) the command after its second generation; return the episodes done."""

    def is_midway() -> bool:
        assert process.poll() is None, process.communicate()[1]
        return evaluations_in(folder) >= 15

    wait_until(is_midway, 'two generations')
    process.send_signal(signal.SIGSTOP)
    wait_until(lambda: stat_of(process.pid)[0] == 'T', 'the process to stop')
    done = evaluations_in(folder)
    assert 15 <= done < EVALUATIONS
    return done


def history_of(folder: Path) -> list[dict[str, str]]:
    with (folder / 'history.csv').open(newline='') as file:
        return list(csv.DictReader(file))


def arrays_of(path: Path) -> dict[str, np.ndarray]:
    with np.load(path, allow_pickle=False) as data:
        return {name: data[name] for name in data.files}


def contents_of(folder: Path) -> dict[str, bytes]:
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.is_file()}


def assert_same_run(one: Path, two: Path) -> None:
    for name in ('config.yaml', 'history.csv', 'best.npz'):
        assert (one / name).read_bytes() == (two / name).read_bytes(), name
    a, b = arrays_of(one / 'checkpoint.npz'), arrays_of(two / 'checkpoint.npz')
    assert a.keys() == b.keys()
    for name, array in a.items():
        assert array.dtype == b[name].dtype
        assert array.tobytes() == b[name].tobytes(), name


def assert_one_line(run: subprocess.CompletedProcess, *words: str) -> None:
    assert run.returncode == 2, run.stderr
    assert run.stdout == ''
    assert run.stderr.count('\n') == 1, run.stderr
    assert run.stderr.startswith('snca evolve: error: ')
    for word in words:
        assert word in run.stderr


class Here:
    """The command line, called in this process with an empty folder as working folder."""

    def __init__(self, folder: Path, capsys) -> None:
        self.folder, self.capsys = folder, capsys

    def run(self, *arguments: object) -> tuple[int, str, str]:
        """Return exit code, standard output and standard error."""
        try:
            code = cli.main(['evolve', *map(str, arguments)])
        except SystemExit as end:  # argparse
            code = end.code
        return code, *self.capsys.readouterr()

    def refuses(self, *arguments: object, words: list[str]) -> None:
        """Check: exit code 2, one line with all `words`, no folder."""
        code, out, err = self.run(*arguments)
        assert (code, out) == (2, '')
        assert err.startswith('snca evolve: error: ')
        assert err.endswith('\n')
        assert err.count('\n') == 1
        for word in words:
            assert word in err
        assert list(self.folder.iterdir()) == []


def stopped_after(episodes):
    """Return a `report` for `evolve` that interrupts the run after some episodes."""
    def stop(progress):
        if progress.episodes >= episodes:
            raise KeyboardInterrupt
    return stop
