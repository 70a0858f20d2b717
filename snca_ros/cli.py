"""The `snca` command and its sub-commands; each loads only what it needs."""

import importlib
import os
import signal
import sys
from concurrent.futures import BrokenExecutor
from types import ModuleType

from sim_node.errors import InvalidInput, check_name
from snca_ros import __version__
from snca_ros.command_line import CommandParser
from snca_ros.graph.child_process import end_with_parent

COMMANDS = {
    'walk': ('snca_ros.commands.walk', 'let a trained robot walk: all its nodes, a bag, a report'),
    'voxels': ('snca_ros.commands.voxels', 'run voxels of a robot that walks on another machine'),
    'policy': ('snca_ros.commands.policy', 'write the SROS 2 policy of a robot'),
    'evolve': ('snca_ros.commands.evolve', 'train parameters offline'),
    'history': ('snca_ros.commands.history', 'show the progress of runs of evolve'),
    'campaign': ('snca_ros.commands.campaign', 'evolve and assess many runs, resumable'),
    'assess': ('snca_ros.commands.assess', 'score controllers on unseen terrains'),
    'study': ('snca_ros.commands.study', 'statistics and figures of campaigns, on one page'),
    'report': ('snca_ros.commands.report', 'read a bag back: v_x, firing rates, lost messages'),
    'replay': ('snca_ros.commands.replay', 'a page that plays a walk: of a controller, run or bag'),
    'render': ('snca_ros.commands.render', 'draw walks of controllers and bags: GIF, MP4, PNG'),
    'completion': (
        'snca_ros.commands.completion', 'print what lets a shell complete commands and options'
    ),
}
"""Commands with an argparse command line: module and what it does."""

NODES = {
    'sim_node': ('sim_node.ros.node', 'the body and its world as a ROS node'),
    'voxel_node': ('snca_ros.nodes.voxel', 'one voxel (or several) as a ROS node'),
    'recorder_node': ('snca_ros.nodes.recorder', 'records the graph into a bag'),
}
"""ROS nodes, which take --ros-args: module and what it does."""

EXAMPLES = """
  snca walk                      # the biped in the box walks 30 s; bag, report, comparison
  snca evolve --engine batched --shape tripod --evaluations 3000 --run runs/tripod
  snca walk runs/tripod/best.npz
"""

BAD_INPUT = 2


def main(argv: list[str] | None = None) -> int:
    """Run the command named first; return the exit code."""
    argv = sys.argv[1:] if argv is None else argv
    name = argv[0] if argv else '--help'
    try:
        if name in ('-h', '--help'):
            print(_overview(), flush=True)
            return 0
        if name == '--version':
            print(f'snca_ros {__version__}', flush=True)
            return 0
        if name in NODES:
            return _run_node(name, argv[1:])
        check_name('command', name, [*COMMANDS, *NODES])
        return _run_command(name, argv[1:])
    except InvalidInput as error:
        print(f'snca {name}: error: {error}', file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        return 130
    except BrokenPipeError:  # nobody reads on; what is still in the buffer goes nowhere
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 1
    except BrokenExecutor as error:  # a worker process that was killed
        print(f'snca {name}: error: {error}', file=sys.stderr)
        return 1
    except OSError as error:  # a full disk, a folder that has gone
        print(f'snca {name}: error: {error}', file=sys.stderr)
        return 1


def load(module: str) -> ModuleType:
    """Return the module of a command or node; InvalidInput if it needs ROS and there is none."""
    try:
        return importlib.import_module(module)
    except ModuleNotFoundError as error:
        if (error.name or '').partition('.')[0] != 'rclpy':
            raise
        expected = "rclpy: pip install 'snca_ros[ros]', or source the setup file of ROS 2 Jazzy"
        raise InvalidInput('ROS 2', None, expected) from None


def _run_node(name: str, argv: list[str]) -> int:
    end_with_parent()
    # Until the node has its own handlers, asked to end means that there is nothing to finish.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return load(NODES[name][0]).main(argv)
    except KeyboardInterrupt:
        return 0


def _run_command(name: str, argv: list[str]) -> int:
    module_name, text = COMMANDS[name]
    module = load(module_name)
    parser = CommandParser(name, text, module)
    # `ros2 run` and `ros2 launch` may append --ros-args; a command that is no node ignores them.
    if '--ros-args' in argv:
        argv = argv[: argv.index('--ros-args')]
    return module.run(parser.parse_args(argv), parser)


def _overview() -> str:
    lines = ['usage: snca COMMAND [options]', '', 'commands:']
    lines += [f'  {name:14}{text}' for name, (_, text) in COMMANDS.items()]
    lines += ['', 'ROS nodes (take --ros-args):']
    lines += [f'  {name:14}{text}' for name, (_, text) in NODES.items()]
    lines += ['', 'examples:', *EXAMPLES.strip('\n').splitlines()]
    lines += ['', 'snca COMMAND --help tells the options of a command.']
    return '\n'.join(lines)
