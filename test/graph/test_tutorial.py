"""The commands of the tutorial, in order, by real processes, with short episodes."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from support.limits import LIMIT
from support.paths import ROOT
from support.processes import children_of, wait_until

BUDGET = [  # replacements that make the commands shorter
    ('--episodes 3000', '--episodes 36 --duration 2 --transient 1 --workers 1'),
    ('--duration 30 --real-time', '--duration 6 --real-time'),
    ('--duration 30', '--duration 2 --voxels-per-process 5'),
    ('@10', '@1'),
    ('--terrains flat,hilly-1-10-0,uphill-10', '--terrains flat --workers 1'),
    ('--faults death=0..1..0.25@5 --starts 3', '--faults death=0..1..1@5 --starts 0 --workers 1'),
    ('tripod.gif', 'tripod.gif --duration 1'),
]


def commands():
    """Return the tutorial's blocks of commands, but for the activation of the environment."""
    text = (ROOT / 'docs' / 'tutorial.md').read_text()
    blocks = [block.strip() for block in re.findall(r'(?:^    .*\n)+', text, re.MULTILINE)]
    assert blocks.pop(0) == '. .venv/bin/activate'
    for long, short in BUDGET:
        assert any(long in block for block in blocks), long
        blocks = [block.replace(long, short) for block in blocks]
    return blocks


@pytest.mark.slow
@pytest.mark.skipif(shutil.which('pkill') is None, reason='needs pkill (procps)')
def test_the_commands_of_the_tutorial_work(tmp_path):
    bin_folder = tmp_path / 'bin'
    bin_folder.mkdir()
    for name, arguments in [('snca', '-m snca_ros '), ('python', '')]:
        (bin_folder / name).write_text(f'#!/bin/sh\nexec {sys.executable} {arguments}"$@"\n')
        (bin_folder / name).chmod(0o755)
    path = f'{bin_folder}{os.pathsep}{os.environ["PATH"]}'
    environment = {**os.environ, 'PATH': path, 'PYTHONPATH': str(ROOT)}
    outputs, children, walking = [], [], None

    def start(block):
        children.append(subprocess.Popen(
            ['bash', '-euc', block], cwd=tmp_path, env=environment, text=True,
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        ))
        return children[-1]

    def finish(child):
        output, _ = child.communicate(timeout=LIMIT)  # on a cold cache the first one compiles
        assert child.returncode == 0, f'{child.args[-1]}\n{output}'
        outputs.append(output)

    try:
        for block in commands():
            if block.startswith('pkill'):  # of all voxels of that name only this walk's
                wait_until(lambda: size_of(tmp_path / 'bags' / 'killed' / 'killed.mcap') > 50_000)
                (server,) = children_of(walking.pid)
                finish(start(block.replace('pkill', f'pkill -P {server}')))
                finish(walking)
            elif '--real-time' in block:
                walking = start(block)
            else:
                finish(start(block))
    finally:
        for child in children:
            if child.poll() is None:
                child.kill()
                child.communicate()

    log = '\n'.join(outputs)
    assert log.count('bit for bit the same') >= 2  # whole and dead
    assert 'voxel_node voxel_2_0 ended with code -9: the walk continues without it' in log
    assert re.search(r'^whole .+\ndead .+\nkilled .+$', log, re.MULTILINE)
    names = 'whole', 'dead', 'killed'
    unsent = {name: unsent_actuation(tmp_path / f'{name}.json') for name in names}
    assert unsent['whole'] == unsent['dead'] == 0 < unsent['killed']
    for name in ('tripod.gif', 'death.png', 'bags/whole/report.png'):
        assert (tmp_path / name).stat().st_size > 1000


def size_of(path: Path) -> int:
    return path.stat().st_size if path.exists() else 0


def unsent_actuation(path: Path) -> int:
    return json.loads(path.read_text())['topics']['/tripod/voxel_2_0/actuation']['never_sent']
