"""(ROS) The `voxels` command: runs voxels of a robot whose simulation is on another machine."""

import argparse
import signal
import sys
from contextlib import ExitStack
from dataclasses import replace

from sim_node.errors import InvalidInput
from sim_node.ros import security
from sim_node.ros.domain import check_domain
from snca_ros.bundled import find_controller
from snca_ros.commands.body_options import add_body_options, load_in_body
from snca_ros.commands.declared_options import add_option
from snca_ros.faults import FAULTS_HELP, parse_faults
from snca_ros.graph.description import WalkOptions, describe_graph
from snca_ros.graph.supervisor import supervise_voxels

EXAMPLES = """
  snca voxels biped-U-nD-snn-h --only 2/2          # while the other machine runs
  snca walk biped-U-nD-snn-h --only 1/2
  snca voxels best.npz --only voxel_0_0,voxel_1_0 --real-time --respawn
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `voxels`."""
    parser.add_argument('controller', help='controller file, or the name of a bundled one')
    add_body_options(parser)
    parser.add_argument('--only', required=True, metavar='VOXELS',
                        help='voxels to run: K/N, the Kth of N shares, or voxel_0_0,voxel_1_0,...')
    parser.add_argument('--real-time', action='store_true',
                        help='do not wait for neighbours; needed if the walk has --real-time')
    add_option(parser, WalkOptions, 'reliability')
    parser.add_argument('--respawn', action='store_true',
                        help='restart voxels that were killed')
    parser.add_argument('--faults', default='', metavar='SPEC',
                        help=f'the same as those of the walk: {FAULTS_HELP}')
    parser.add_argument('--robot', default='', help='namespace (default: the shape)')
    add_option(parser, WalkOptions, 'voxels_per_process', metavar='K')


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Run voxels for one walk, until its simulation has ended; return the exit code."""
    check_domain()
    security.check_middleware()
    path = find_controller(args.controller)
    options = WalkOptions(
        args.robot, real_time_factor=float(args.real_time),
        voxels_per_process=args.voxels_per_process, only=args.only, one_walk=True,
        faults=parse_faults(args.faults), reliability=args.reliability,
    )
    with ExitStack() as stack:
        file, trained = load_in_body(path, args.shape, args.without, stack)
        graph = replace(describe_graph(file, trained, options), simulation=None)
        if not graph.voxels:
            raise InvalidInput('only', args.only, 'at least one voxel')
        names = ', '.join(name for process in graph.voxels for name in process.names)
        print(f'/{graph.robot}: {names}', file=sys.stderr)
        signal.signal(signal.SIGTERM, signal.default_int_handler)
        try:
            return supervise_voxels(graph, args.respawn)
        except KeyboardInterrupt:
            return 0
