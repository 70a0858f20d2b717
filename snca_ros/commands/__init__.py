"""The sub-commands of `snca`, one module each.

The module of a command has `EXAMPLES`, `add_arguments(parser)` and `run(args, parser)`, which
returns the exit code. A command with the option --json calls `args.write_json` with its results.
It is imported only when the command is called.
"""

from types import ModuleType

from snca_ros.command_line import load_module

COMMANDS = {
    'walk': 'run a trained robot with all its nodes, record a bag, print a report',
    'voxels': 'run voxels of a robot whose simulation is on another machine',
    'policy': 'write the SROS 2 policy of a robot',
    'evolve': 'train parameters offline',
    'history': 'show the progress of runs of evolve',
    'campaign': 'evolve and assess many runs, resumable',
    'assess': 'score controllers on unseen terrains',
    'bodies': 'search bodies of every size and number of feet for a controller',
    'firmware': 'write a trained cell as C for microcontrollers',
    'study': 'compare results of campaigns: statistics and figures on one page',
    'report': 'report on a bag: v_x, firing rates, lost messages',
    'replay': 'write a page that plays the walk of a controller, run or bag',
    'render': 'draw walks of controllers and bags: GIF, MP4, PNG',
    'completion': 'print the shell script that completes commands and options',
}
"""Name and description of each command."""


def load_command(name: str) -> ModuleType:
    """Return the module of a command; InvalidInput if it needs ROS and ROS is not installed."""
    return load_module(f'{__name__}.{name}')
