"""(ROS) The `policy` command: prints the SROS 2 policy of a robot."""

import argparse
import sys

from snca_ros.bundled import find_controller
from snca_ros.commands.body_options import add_body_options
from snca_ros.commands.declared_options import add_option
from snca_ros.controller_file import load_controller
from snca_ros.graph.description import WalkOptions, describe_graph
from snca_ros.graph.sros_policy import policy_xml
from snca_ros.nodes.cell_messages import topic_name

EXAMPLES = """
  snca policy biped-U-nD-snn-h > policy.xml
  snca policy runs/tripod/best.npz --robot alice --voxels-per-process 4 > policy.xml
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `policy`."""
    parser.add_argument('controller', help='controller file, or the name of a bundled one')
    add_body_options(parser)
    parser.add_argument('--robot', default='', help='namespace (default: the shape)')
    add_option(parser, WalkOptions, 'voxels_per_process', metavar='K')


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Print the policy; return the exit code."""
    path = find_controller(args.controller)
    trained = load_controller(path).in_body(args.shape).without(args.without)
    options = WalkOptions(args.robot, voxels_per_process=args.voxels_per_process, bag='any')
    graph = describe_graph(path, trained, options)
    sys.stdout.write(policy_xml(graph, topic_name(trained.architecture)) + '\n')
    return 0
