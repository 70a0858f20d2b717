"""The executables that run ROS nodes, by the names that `ros2 run` and `snca` use."""

from pkgutil import resolve_name

from sim_node.errors import InvalidInput
from sim_node.ros.interface import node_help
from sim_node.ros.stop_signals import exit_at_stop_signals
from snca_ros.command_line import exit_code, load_module
from snca_ros.graph.child_process import end_with_parent

NODES = {
    'sim_node': ('sim_node.ros.node', 'the body and its world as a ROS node'),
    'voxel_node': ('snca_ros.nodes.voxel', 'one voxel (or several) as a ROS node'),
    'recorder_node': ('snca_ros.nodes.recorder', 'records the graph into a bag'),
}
"""Module and help text of each executable; all of them take --ros-args."""

_INTERFACES = {
    'sim_node': 'sim_node.ros.sim_interface:SIM_NODE',
    'voxel_node': 'snca_ros.nodes.interfaces:VOXEL_NODE',
    'recorder_node': 'snca_ros.nodes.interfaces:RECORDER_NODE',
}
_TAKE_NAMES = ('voxel_node',)  # of the nodes to run


def run_node(name: str, argv: list[str]) -> int:
    """Run a node in this process until it ends; return the exit code."""
    exit_at_stop_signals(0)  # until the node installs its own handlers, it has nothing to finish
    return exit_code(name, lambda: _run(name, argv))


def _run(name: str, argv: list[str]) -> int:
    own = argv[: argv.index('--ros-args')] if '--ros-args' in argv else argv
    if '-h' in own or '--help' in own:
        print(node_help(resolve_name(_INTERFACES[name])), flush=True)
        return 0
    if own and name not in _TAKE_NAMES:
        expected = f"nothing before --ros-args, which takes parameters: 'snca {name} --help'"
        raise InvalidInput('arguments', ' '.join(own), expected)
    end_with_parent()
    return load_module(NODES[name][0]).main(argv)
