"""(ROS) The `voxels` command: some voxels of a robot, whose simulation is on another machine."""

import argparse
import os
import signal
import sys
import time
from dataclasses import replace

import rclpy  # noqa: F401  # the voxels are forks that have it

from sim_node.errors import InvalidInput
from sim_node.ros import security
from snca_ros.bundled import find_controller
from snca_ros.controller_file import load_controller
from snca_ros.faults import parse_faults
from snca_ros.graph.description import Graph, NodeProcess, WalkOptions, describe_graph
from snca_ros.graph.environment import graph_environment
from snca_ros.graph.network import await_network
from snca_ros.graph.processes import RunningGraph

EXAMPLES = """
  snca voxels biped-U-nD-snn-h --only 2/2          # while the other machine runs
  snca walk biped-U-nD-snn-h --only 1/2
  snca voxels best.npz --only voxel_0_0,voxel_1_0 --real-time --respawn
"""

_LOOK_PERIOD = 0.2  # seconds between looks at who has ended


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `voxels`."""
    parser.add_argument('controller', help='controller file, or the name of one in the box')
    parser.add_argument('--only', required=True, metavar='VOXELS',
                        help='K/N, the Kth of N shares, or voxel_0_0,voxel_1_0,...')
    parser.add_argument('--real-time', action='store_true',
                        help='as the walk: never wait for a neighbour')
    parser.add_argument('--respawn', action='store_true',
                        help='start voxels again that were killed')
    parser.add_argument('--faults', default='', metavar='SPEC',
                        help='the same as the walk has')
    parser.add_argument('--robot', default='', help='namespace (default: the shape)')
    parser.add_argument('--voxels-per-process', type=int, default=1, metavar='K',
                        help='voxels that share a process (default 1)')


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Run voxels for one walk, until its simulation is gone; return the exit code."""
    security.check_middleware()
    path = find_controller(args.controller)
    options = WalkOptions(
        args.robot, real_time_factor=float(args.real_time),
        voxels_per_process=args.voxels_per_process, only=args.only, one_walk=True,
        faults=parse_faults(args.faults),
    )
    graph = replace(describe_graph(path, load_controller(path), options), simulation=None)
    if not graph.voxels:
        raise InvalidInput('only', args.only, 'at least one voxel')
    names = ', '.join(name for process in graph.voxels for name in process.names)
    print(f'/{graph.robot}: {names}', file=sys.stderr)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    environment = graph_environment('network')
    os.environ.update(environment)
    try:
        await_network()
        with RunningGraph(graph, environment) as running:
            return _watch(graph, running, args.respawn)
    except KeyboardInterrupt:
        return 0


def _watch(graph: Graph, running: RunningGraph, respawn: bool) -> int:
    """Wait until a voxel ends because its simulation has, or all have failed; 1 if one has."""
    given_up: set[NodeProcess] = set()
    while len(given_up) < len(graph.voxels):
        time.sleep(_LOOK_PERIOD)
        for process in {*running.ended()} - given_up:
            code = running.exit_code(process)
            if code == 0:
                return 1 if given_up else 0
            said = f'{" ".join(process.names)} ended with code {code}'
            if respawn and code is not None and code < 0:  # a signal's doing
                print(f'{said}: started again', file=sys.stderr)
                running.start_again(process)
            else:
                print(said, file=sys.stderr)
                given_up.add(process)
    return 1
