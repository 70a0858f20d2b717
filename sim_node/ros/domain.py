"""Checks the ROS domain that the environment sets, before ROS reads it."""

import os

from sim_node.errors import InvalidInput

DOMAIN = 'ROS_DOMAIN_ID'

HIGHEST = 232
"""Domain with the highest ports of UDP."""


def check_domain() -> None:
    """Raise InvalidInput if the environment sets a domain that has no ports."""
    text = os.environ.get(DOMAIN, '').strip()
    if text and not (text.isascii() and text.isdigit() and int(text) <= HIGHEST):
        raise InvalidInput(DOMAIN, text, f'an integer from 0 to {HIGHEST}')
