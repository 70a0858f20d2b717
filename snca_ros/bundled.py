"""What is in the box: config/ with its controllers, in a checkout or installed."""

import os
import sys
from pathlib import Path

from sim_node.errors import InvalidInput, near_miss

DEFAULT_CONTROLLER = 'biped-U-nD-snn-h'

PROFILE_VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
"""What names the profile of Fast DDS 2, which Jazzy has, and of Fast DDS 3."""


def config_folders() -> list[Path]:
    """Return the folders that hold config/, the checkout's before the installed ones."""
    prefixes = [sys.prefix, *os.environ.get('AMENT_PREFIX_PATH', '').split(os.pathsep)]
    installed = [Path(p) / 'share' / 'snca_ros' / 'config' for p in prefixes if p]
    return [Path(__file__).resolve().parents[1] / 'config', *installed]


def graph_environment(reach: str = 'loopback') -> dict[str, str]:
    """Return what a graph's processes need in their environment to reach each other.

    A profile of the user's own, or another middleware than Fast DDS, is left as it is.

    Args:
        reach: `loopback` keeps the graph on this host; `network` is for voxels on several.
    """
    if any(name in os.environ for name in PROFILE_VARIABLES):
        return {}
    profiles = [folder / f'fastdds-{reach}.xml' for folder in config_folders()]
    profile = next((path for path in profiles if path.exists()), None)
    rmw = os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp')
    if profile is None or 'fastrtps' not in rmw:
        alone = reach == 'loopback'
        return {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST' if alone else 'SUBNET'}
    # The profile chooses the interfaces. LOCALHOST would replace its transports.
    return {
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET',
        **dict.fromkeys(PROFILE_VARIABLES, str(profile)),
    }


def bundled_controllers() -> dict[str, Path]:
    """Return the bundled controllers, name to file."""
    folders = [folder / 'controllers' for folder in config_folders()]
    return {p.stem: p for folder in reversed(folders) for p in sorted(folder.glob('*.npz'))}


def find_controller(name: str) -> Path:
    """Return the file of a controller named by path or a bundled one by its name."""
    bundled = bundled_controllers()
    if name in bundled and not Path(name).exists():
        return bundled[name]
    if not Path(name).exists():
        known = ', '.join(bundled)
        expected = f'a controller file or one of {known}' + near_miss(name, bundled)
        raise InvalidInput('controller', name, expected)
    return Path(name)
