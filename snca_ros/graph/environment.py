"""What the processes of a graph need in their environment: Fast DDS profiles, and their reach."""

import os

from snca_ros.bundled import config_folders

PROFILE_VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
"""What names the profile of Fast DDS 2, which Jazzy has, and of Fast DDS 3."""


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
