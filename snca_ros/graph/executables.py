"""The ROS nodes as programs, by the names under which `ros2 run` and `snca` start them."""

import signal

from snca_ros.command_line import exit_code, load_module
from snca_ros.graph.child_process import end_with_parent

NODES = {
    'sim_node': ('sim_node.ros.node', 'the body and its world as a ROS node'),
    'voxel_node': ('snca_ros.nodes.voxel', 'one voxel (or several) as a ROS node'),
    'recorder_node': ('snca_ros.nodes.recorder', 'records the graph into a bag'),
}
"""Nodes, which take --ros-args: module and what it does."""


def run_node(name: str, argv: list[str]) -> int:
    """Run a node in this process until it ends; return the exit code."""
    return exit_code(name, lambda: _run(NODES[name][0], argv))


def _run(module: str, argv: list[str]) -> int:
    end_with_parent()
    # Until the node has its own handlers, asked to end means that there is nothing to finish.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return load_module(module).main(argv)
    except KeyboardInterrupt:
        return 0
