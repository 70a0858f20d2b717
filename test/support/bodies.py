"""A small search for bodies, in this process or as one of its own."""

import subprocess
import sys
from pathlib import Path

import numpy as np
from support.paths import ROOT

from sim_node.model.morphology import parse_morphology
from snca_ros import cli
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import save_controller
from snca_ros.trained_controller import TrainedController

WORM = 'worm-U-D-mlp'
"""A bundled controller, evolved in five voxels in a row."""

OPTIONS = (
    '--starts', 2, '--voxels', 6, '--width', 5, '--height', 2, '--batch', 4, '--duration', 5.5,
    '--seed', 3, '--engine', 'batched',
)
EPISODES = 22
"""Of the whole search: 11 bodies in batches of 4, 4 and 3."""


def save_worm(path: Path, architecture: str = 'U-D', seed: int = 0) -> Path:
    """Write a random controller of a worm, and return the path."""
    cells, body = Architecture.named(architecture, 'mlp'), parse_morphology('worm-3x1')
    n = cells.n_parameters(body.n_voxels)
    theta = np.random.default_rng(seed).uniform(-1.0, 1.0, n)
    save_controller(path, TrainedController(cells, body, theta))
    return path


def bodies(*arguments: object, capsys) -> tuple[int, str, str]:
    """Run the command in this process; return exit code, standard output and standard error."""
    code = cli.main(['bodies', *map(str, arguments)])
    return code, *capsys.readouterr()


def start(*arguments: object) -> subprocess.Popen:
    """Start the command as a process."""
    return subprocess.Popen(
        [sys.executable, '-m', 'snca_ros', 'bodies', *map(str, arguments)], cwd=ROOT, text=True,
        stdout=subprocess.PIPE, stderr=subprocess.PIPE,
    )


def contents_of(folder: Path) -> dict[str, bytes]:
    """Return the contents of all files but figures, by name."""
    return {p.name: p.read_bytes() for p in folder.iterdir() if p.suffix != '.png'}
