"""Files that come with the package: config/ with its controllers, in a checkout or installed."""

import os
import sys
from pathlib import Path

from sim_node.errors import InvalidInput, near_miss

DEFAULT_CONTROLLER = 'biped-U-nD-snn-h'


def config_folders() -> list[Path]:
    """Return the possible paths of config/: that of the checkout, then those of installations.

    The prefix of the installation may differ from that of Python, as with `pip install --user` or
    `--target`.
    """
    own = Path(__file__).resolve().parents[1]
    ament = os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)
    prefixes = [*map(str, (own, *own.parents[:4])), sys.prefix, *ament]
    installed = [Path(p) / 'share' / 'snca_ros' / 'config' for p in prefixes if p]
    return [own / 'config', *installed]


def bundled_controllers() -> dict[str, Path]:
    """Return the files of the bundled controllers by name."""
    folders = [folder / 'controllers' for folder in config_folders()]
    return {p.stem: p for folder in reversed(folders) for p in sorted(folder.glob('*.npz'))}


def find_controller(name: str) -> Path:
    """Return the file of a controller: a path, the best of a run folder, or a bundled name.

    Raises:
        InvalidInput: there is no such file or name.
    """
    bundled = bundled_controllers()
    if (Path(name) / 'config.yaml').exists():
        return Path(name) / 'best.npz'
    if name in bundled and not Path(name).exists():
        return bundled[name]
    if not Path(name).exists():
        hint = near_miss(name, list(bundled))
        expected = f'a controller file or one of {", ".join(bundled)}{hint}'
        raise InvalidInput('controller', name, expected)
    return Path(name)
