"""Environment variables of a graph's processes: the Fast DDS profile and the discovery range."""

import os

from snca_ros.bundled import config_folders

PROFILE_VARIABLES = ('FASTRTPS_DEFAULT_PROFILES_FILE', 'FASTDDS_DEFAULT_PROFILES_FILE')
"""Environment variables that name the profile: of Fast DDS 2 (in Jazzy) and of Fast DDS 3."""


def graph_environment(reach: str = 'loopback') -> dict[str, str]:
    """Return the environment variables that a graph's processes need to discover each other.

    Returns nothing if the user has set a profile. For another middleware than Fast DDS it sets the
    discovery range only.

    Args:
        reach: `loopback` for a graph on this host alone, `network` for voxels on several hosts.
    """
    if any(name in os.environ for name in PROFILE_VARIABLES):
        return {}
    profiles = [folder / f'fastdds-{reach}.xml' for folder in config_folders()]
    profile = next((path for path in profiles if path.exists()), None)
    rmw = os.environ.get('RMW_IMPLEMENTATION', 'rmw_fastrtps_cpp')
    if profile is None or 'fastrtps' not in rmw:
        alone = reach == 'loopback'
        return {'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST' if alone else 'SUBNET'}
    # The profile selects the interfaces. LOCALHOST would replace its transports.
    return {
        'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET',
        **dict.fromkeys(PROFILE_VARIABLES, str(profile)),
    }
