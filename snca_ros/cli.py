"""The `snca` command, which runs the sub-command or node that its first argument names."""

import os
import sys

from sim_node.errors import check_name
from snca_ros import __version__
from snca_ros.command_line import CommandParser, exit_code
from snca_ros.commands import COMMANDS, load_command
from snca_ros.commands.json_output import json_output
from snca_ros.graph.executables import NODES, run_node
from snca_ros.interrupts import exiting_at_interrupt
from snca_ros.standard_streams import prepare_streams

EXAMPLES = """
  snca walk                      # a 30 s walk of the bundled biped, with bag and report
  snca evolve --engine batched --shape tripod --episodes 3000 --run runs/tripod
  snca walk runs/tripod/best.npz
"""


def main(argv: list[str] | None = None) -> int:
    """Run the command or node that the first argument names; return the exit code."""
    prepare_streams()
    os.environ['MPLBACKEND'] = 'agg'  # a notebook's may not exist here; figures go to files
    os.environ['PYTHONSAFEPATH'] = '1'  # child processes import nothing from this directory
    argv = sys.argv[1:] if argv is None else argv
    name = argv[0] if argv else '--help'
    if name in NODES:
        return run_node(name, argv[1:])
    return exit_code(name, lambda: _run(name, argv[1:]))


def _run(name: str, argv: list[str]) -> int:
    if name in ('-h', '--help'):
        print(_overview(), flush=True)
        return 0
    if name == '--version':
        print(f'snca_ros {__version__}', flush=True)
        return 0
    check_name('command', name, [*COMMANDS, *NODES])
    # `ros2 run` and `ros2 launch` may append --ros-args, which only nodes use.
    if '--ros-args' in argv:
        argv = argv[: argv.index('--ros-args')]
    with exiting_at_interrupt():
        module = load_command(name)
        parser = CommandParser(name, COMMANDS[name], module)
        args = parser.parse_args(argv)
    with json_output(getattr(args, 'json', None)) as args.write_json:
        return module.run(args, parser)


def _overview() -> str:
    lines = ['usage: snca COMMAND [options]', '', 'commands:']
    lines += [f'  {name:14}{text}' for name, text in COMMANDS.items()]
    lines += ['', 'ROS nodes (take --ros-args):']
    lines += [f'  {name:14}{text}' for name, (_, text) in NODES.items()]
    lines += ['', 'examples:', *EXAMPLES.strip('\n').splitlines()]
    lines += ['', 'snca COMMAND --help describes a command, or a node and its parameters.']
    return '\n'.join(lines)
