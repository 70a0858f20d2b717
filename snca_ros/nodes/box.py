"""The controllers in the box: config/controllers, in a checkout or installed."""

import os
import sys
from pathlib import Path

from sim_node.errors import InvalidInput, near_miss

DEFAULT_CONTROLLER = 'biped-U-nD-snn-h'

_INSTALLED = Path('share') / 'snca_ros' / 'config' / 'controllers'


def boxed_controllers() -> dict[str, Path]:
    """Return the controllers in the box, name to file."""
    prefixes = [sys.prefix, *os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)]
    checkout = Path(__file__).resolve().parents[2] / 'config' / 'controllers'
    folders = [checkout, *(Path(prefix) / _INSTALLED for prefix in prefixes if prefix)]
    return {p.stem: p for folder in reversed(folders) for p in sorted(folder.glob('*.npz'))}


def find_controller(name: str) -> Path:
    """Return the file of a controller named by path or by its name in the box."""
    boxed = boxed_controllers()
    if name in boxed and not Path(name).exists():
        return boxed[name]
    if not Path(name).exists():
        expected = f'a controller file or one of {", ".join(boxed)}' + near_miss(name, list(boxed))
        raise InvalidInput('controller', name, expected)
    return Path(name)
