"""SROS 2 when the environment asks for it: a graph that is refused rather than open by mistake."""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from sim_node.errors import InvalidInput

ENABLE, STRATEGY, KEYSTORE = (
    'ROS_SECURITY_ENABLE', 'ROS_SECURITY_STRATEGY', 'ROS_SECURITY_KEYSTORE'
)
NO_PLUGINS = 'security libraries'  # what rmw_fastrtps says it lacks
_PROBE = 'import rclpy; rclpy.init(args=[]); rclpy.create_node("probe")'
_WANTED = 'a middleware with security plugins; the one from PyPI has none (docs/security.md)'


def is_requested() -> bool:
    """Tell whether the environment asks for security.

    rcl itself takes any value of these variables that it does not know for a no.

    Raises:
        InvalidInput: it asks for something that would leave the graph open.
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
    """Raise InvalidInput if security is asked for and the middleware is built without it."""
    if not is_requested():
        return
    with tempfile.TemporaryDirectory() as keystore:  # without keys: nodes fail for one reason or
        (Path(keystore) / 'enclaves').mkdir()        # the other, and say for which
        probe = subprocess.run(
            [sys.executable, '-c', _PROBE], check=False, capture_output=True, text=True,
            env={**os.environ, KEYSTORE: keystore},
        )
    if NO_PLUGINS in probe.stderr:
        raise InvalidInput(ENABLE, 'true', _WANTED)


def explained(reason: str) -> str:
    """Return why a node could not be made although security was asked for."""
    if NO_PLUGINS in reason:
        return str(InvalidInput(ENABLE, 'true', _WANTED))
    keystore = os.environ.get(KEYSTORE, '')
    expected = f'a keystore with the enclave of this node (docs/security.md): {reason}'
    return str(InvalidInput(KEYSTORE, keystore, expected))
