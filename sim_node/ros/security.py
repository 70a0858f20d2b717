"""Checks of the environment's SROS 2 settings, so that a graph is never insecure by mistake."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from sim_node.errors import InvalidInput

ENABLE, STRATEGY, KEYSTORE = (
    'ROS_SECURITY_ENABLE', 'ROS_SECURITY_STRATEGY', 'ROS_SECURITY_KEYSTORE'
)
NO_PLUGINS = 'security libraries'  # in the error of rmw_fastrtps built without plug-ins
_PROBE = 'import rclpy; rclpy.init(args=[]); rclpy.create_node("probe")'
_WANTED = 'a middleware with security plugins; the one from PyPI has none (docs/security.md)'


def is_requested() -> bool:
    """Return whether the environment enables security.

    rcl itself treats unknown values of these variables as false, which leaves the graph insecure.

    Raises:
        InvalidInput: a variable has another value, or the strategy allows nodes without keys.
    """
    enable = os.environ.get(ENABLE, '')
    if enable in ('', 'false'):
        return False
    if enable != 'true':
        raise InvalidInput(ENABLE, enable, 'true or false')
    strategy = os.environ.get(STRATEGY, '')
    if strategy != 'Enforce':
        raise InvalidInput(STRATEGY, strategy, 'Enforce, without which nodes without keys run')
    return True


def check_middleware() -> None:
    """Raise InvalidInput if security is enabled but the middleware is built without it."""
    if not is_requested():
        return
    # With an empty keystore the node fails; the error shows whether plug-ins or keys are missing.
    with tempfile.TemporaryDirectory() as keystore:
        (Path(keystore) / 'enclaves').mkdir()
        probe = subprocess.run(
            [sys.executable, '-c', _PROBE], check=False, capture_output=True, text=True,
            env={**os.environ, KEYSTORE: keystore},
        )
    if NO_PLUGINS in probe.stderr:
        raise InvalidInput(ENABLE, 'true', _WANTED)


def explained(reason: str) -> str:
    """Return the error text for a node that could not be created with security enabled."""
    if NO_PLUGINS in reason:
        return str(InvalidInput(ENABLE, 'true', _WANTED))
    keystore = os.environ.get(KEYSTORE, '')
    expected = f'a keystore with the enclave of this node (docs/security.md): {reason}'
    return str(InvalidInput(KEYSTORE, keystore, expected))
