"""Embodied neural cellular automata for modular soft robots: evolution, simulation, ROS 2 nodes.

The functions and classes for notebooks and scripts are here, see docs/python.md:

    import snca_ros as snca
    robot = snca.load('biped-U-nD-snn-h')
    episode = robot.run(10.0, record='spikes')

Each name is imported when it is first used, so that `import snca_ros` is fast.
"""

import importlib
from typing import TYPE_CHECKING

__version__ = '0.1.0'

__all__ = [
    'EvolutionRun',
    'Faults',
    'Gait',
    'InvalidInput',
    'RecordedEpisode',
    'Recording',
    'Robot',
    'Scores',
    'assess',
    'bundled_controllers',
    'evolve',
    'load',
    'measure_gait',
    'read_bag',
    'spike_times',
]

if TYPE_CHECKING:
    from sim_node.errors import InvalidInput
    from snca_ros.api.assessment import Scores, assess
    from snca_ros.api.evolution import EvolutionRun, evolve
    from snca_ros.api.robot import Robot, load
    from snca_ros.bundled import bundled_controllers
    from snca_ros.faults import Faults
    from snca_ros.recording.bag import read_bag
    from snca_ros.recording.episode import RecordedEpisode
    from snca_ros.recording.gait import Gait, measure_gait, spike_times
    from snca_ros.recording.recording import Recording

_MODULES = {
    'sim_node.errors': ('InvalidInput',),
    'snca_ros.api.assessment': ('Scores', 'assess'),
    'snca_ros.api.evolution': ('EvolutionRun', 'evolve'),
    'snca_ros.api.robot': ('Robot', 'load'),
    'snca_ros.bundled': ('bundled_controllers',),
    'snca_ros.faults': ('Faults',),
    'snca_ros.recording.bag': ('read_bag',),
    'snca_ros.recording.episode': ('RecordedEpisode',),
    'snca_ros.recording.gait': ('Gait', 'measure_gait', 'spike_times'),
    'snca_ros.recording.recording': ('Recording',),
}


def __getattr__(name: str) -> object:
    for module, names in _MODULES.items():
        if name in names:
            found = getattr(importlib.import_module(module), name)
            globals()[name] = found
            return found
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
