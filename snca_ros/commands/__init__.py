"""The sub-commands of `snca`, one file each: its options, their checks, and what it prints.

The file of a command has `EXAMPLES`, `add_arguments(parser)` and `run(args, parser)`, which returns
the exit code. It is loaded when the command is called, and not before.
"""

from types import ModuleType

from snca_ros.command_line import load_module

COMMANDS = {
    'walk': 'let a trained robot walk: all its nodes, a bag, a report',
    'voxels': 'run voxels of a robot that walks on another machine',
    'policy': 'write the SROS 2 policy of a robot',
    'evolve': 'train parameters offline',
    'history': 'show the progress of runs of evolve',
    'campaign': 'evolve and assess many runs, resumable',
    'assess': 'score controllers on unseen terrains',
    'study': 'statistics and figures of campaigns, on one page',
    'report': 'read a bag back: v_x, firing rates, lost messages',
    'replay': 'a page that plays a walk: of a controller, run or bag',
    'render': 'draw walks of controllers and bags: GIF, MP4, PNG',
    'completion': 'print what lets a shell complete commands and options',
}
"""Name of each command and what it does."""


def load_command(name: str) -> ModuleType:
    """Return the module of a command; InvalidInput if it needs ROS and there is none."""
    return load_module(f'{__name__}.{name}')
