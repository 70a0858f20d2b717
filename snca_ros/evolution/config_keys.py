"""The keys of a run's configuration in files: former names, later keys, texts of several values."""

from typing import Any

from sim_node.errors import InvalidInput
from snca_ros.evolution.fault_ranges import compact

LATER = ('task', 'faults', 'starts', 'draw', 'score')
"""Keys that the config.yaml of an earlier version may lack. They are first in the file, so that one
that was cut lacks a key that none may lack."""

_FORMER = {'evaluations': 'episodes'}
"""Former names of keys. An evaluation was one episode."""


def present_keys(values: dict) -> dict:
    """Return values with the present names of their keys; InvalidInput if both names are there."""
    for former, present in _FORMER.items():
        if former in values and present in values:
            raise InvalidInput(former, values[former], f'{present} alone, its present name')
    return {_FORMER.get(key, key): value for key, value in values.items()}


def compacted(settings: dict[str, Any]) -> dict[str, Any]:
    """Return settings of a run, with shapes, terrains and faults as texts without spaces."""
    separators = {'shape': ',', 'terrain': ',', 'faults': ';'}
    found = {
        key: compact(value, separators[key]) if key in separators else value
        for key, value in settings.items()
    }
    return {**found, 'faults': ''} if found.get('faults') == 'none' else found
