"""(ROS) The `walk` command: brings a robot's graph up, watches it, takes it down, reports."""

import argparse
import os
import signal
import sys
import time
from collections.abc import Callable
from datetime import datetime
from functools import partial
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.signals import SignalHandlerOptions

from sim_node.control_time import CONTROL_RATE
from sim_node.errors import InvalidInput, check_name
from sim_node.model.morphology import parse_morphology
from sim_node.model.solver import ENGINES
from sim_node.ros import security
from snca_ros.bundled import DEFAULT_CONTROLLER, find_controller, graph_environment
from snca_ros.controller_file import TrainedController, load_controller
from snca_ros.evolution.episode import run_episode
from snca_ros.faults import Faults, parse_faults
from snca_ros.files import check_new_bag
from snca_ros.graph.description import (
    Graph,
    NodeProcess,
    WalkOptions,
    describe_graph,
    robot_name,
)
from snca_ros.graph.network import await_network
from snca_ros.graph.processes import RunningGraph
from snca_ros.nodes.live_view import LiveView
from snca_ros.nodes.recorder import STORAGES
from snca_ros.recording import report
from snca_ros.recording.bag import read_bag
from snca_ros.web.server import check_port

INTERRUPTED = 130
VIEW_PORT = 8765

EXAMPLES = """
  snca walk                                         # the biped in the box, 30 s, in lock-step
  snca walk runs/tripod/best.npz --terrain hilly-1-10-0 --duration 60
  snca walk --real-time --respawn                   # at 60 Hz; killed voxels come back
  snca walk --view                                  # live on a page; click voxels to kill them
  snca walk --faults loss=0.3,death=0.5@10,seed=3   # lost messages; half the voxels die at 10 s
  snca walk --engine batched --bag bags/mine --storage sqlite3
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `walk`."""
    parser.add_argument('controller', nargs='?', default=DEFAULT_CONTROLLER,
                        help='controller file, or the name of one in the box '
                        f'(default {DEFAULT_CONTROLLER})')
    parser.add_argument('--duration', type=float, default=30.0,
                        help='simulated seconds to walk (default 30)')
    parser.add_argument('--real-time', type=float, nargs='?', const=1.0, default=0.0,
                        metavar='FACTOR', help='keep to wall time, or to FACTOR times as fast, '
                        'and never wait for a voxel (default: in lock-step, as fast as it goes)')
    parser.add_argument('--respawn', action='store_true',
                        help='start voxels again that were killed')
    parser.add_argument('--terrain', default='', help='default: the one it was evolved on')
    parser.add_argument('--engine', default='',
                        help=f'{", ".join(ENGINES)} (default {ENGINES[0]})')
    parser.add_argument('--shape', help='refuse a controller of another shape than this')
    parser.add_argument('--robot', default='', help='namespace (default: the shape)')
    parser.add_argument('--voxels-per-process', type=int, default=1, metavar='K',
                        help='voxels that share a process (default 1)')
    parser.add_argument('--faults', default='', metavar='SPEC',
                        help='what goes wrong: name=value,... such as loss=0.3,death=0.5@10, '
                        'or a YAML file; see docs/robustness.md')
    parser.add_argument('--only', default='', metavar='VOXELS',
                        help='voxels of this machine, if `snca voxels` runs the others elsewhere: '
                        'K/N, the Kth of N shares, or voxel_0_0,voxel_1_0,..., or none')
    parser.add_argument('--view', type=int, nargs='?', const=VIEW_PORT, metavar='PORT',
                        help='show the walk live on a page of this machine (default port '
                        f'{VIEW_PORT}), in real time unless --real-time tells otherwise')
    record = parser.add_mutually_exclusive_group()
    record.add_argument('--bag', type=Path, help='bag to write (default bags/<robot>-<time>)')
    record.add_argument('--no-bag', action='store_true', help='record nothing')
    parser.add_argument('--storage', default='mcap',
                        help=f'of the bag: {", ".join(STORAGES)} (default mcap)')


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Walk as the command line says; return the exit code."""
    security.check_middleware()
    path = find_controller(args.controller)
    trained = load_controller(path)
    if not 0.0 < args.duration <= 1e5:
        raise InvalidInput('duration', args.duration, 'seconds from 0 to 100000')
    if not 0.0 <= args.real_time <= 100.0:
        raise InvalidInput('real_time', args.real_time, 'a factor from 0 to 100')
    check_name('storage', args.storage, STORAGES)
    if args.view is not None:
        if not 0 <= args.view < 65536:
            raise InvalidInput('view', args.view, 'a port from 0 to 65535')
        check_port(args.view)
        args.real_time = args.real_time or 1.0
    _check_shape(path, trained, args.shape)
    robot = args.robot or robot_name(trained.morphology)
    bag = args.bag or Path('bags') / f'{robot}-{datetime.now():%Y%m%d-%H%M%S}'
    if not args.no_bag:
        check_new_bag(bag)
    engine = args.engine or ENGINES[0]
    faults = parse_faults(args.faults)
    options = WalkOptions(
        robot, args.terrain, engine, args.duration, args.real_time, args.voxels_per_process,
        only=args.only, bag='' if args.no_bag else str(bag), storage=args.storage, faults=faults,
        simulation={} if args.view is None else {'recorders': 2 - args.no_bag},
    )
    graph = describe_graph(path, trained, options)
    # Also checks all names and compiles the cells before ten processes need them.
    offline = _offline_centers(
        trained, args.terrain or trained.terrain, engine, args.duration, faults
    )
    open_view = None
    if args.view is not None:
        open_view = partial(LiveView, args.view, trained, args.terrain or trained.terrain)
    code = _walk(graph, options, args.respawn, open_view)
    if code or args.no_bag:
        return code
    return _report(bag, offline, may_differ=args.respawn or args.real_time > 0.0)


def _check_shape(path: Path, trained: TrainedController, shape: str | None) -> None:
    if shape is None:
        return
    if not parse_morphology(shape).same_shape(trained.morphology):
        raise InvalidInput('morphology', trained.morphology.grid_string, shape, str(path))


def _offline_centers(
    trained: TrainedController, terrain: str, engine: str, duration: float, faults: Faults
) -> np.ndarray:
    simulation = trained.simulation(terrain, engine, faults=faults)
    controller = trained.controller(faults)
    print('offline first, to compare with', file=sys.stderr, flush=True)
    return run_episode(simulation, controller, duration).centers


def _walk(
    graph: Graph, options: WalkOptions, respawn: bool,
    open_view: Callable[[RunningGraph], LiveView] | None,
) -> int:
    """Run the graph until the simulation is done; return the exit code."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    started = time.monotonic()
    n = sum(len(p.names) for p in graph.voxels)
    print(
        f'/{graph.robot}: {n} voxels in {len(graph.voxels)} processes, one simulation'
        f'{", one recorder" if graph.recorder else ""}', file=sys.stderr,
    )
    environment = graph_environment('network' if options.only else 'loopback')
    os.environ.update(environment)
    try:
        if options.only:
            await_network()
        with RunningGraph(graph, environment) as running:
            code = _watch(graph, running, options, respawn, open_view)
    except KeyboardInterrupt:
        print('\nstopped', file=sys.stderr)
        return INTERRUPTED
    if code == 0:
        taken = time.monotonic() - started
        print(f'walked {options.duration:g} s in {taken:.1f} s, start included', file=sys.stderr)
    return code


def _watch(
    graph: Graph, running: RunningGraph, options: WalkOptions, respawn: bool,
    open_view: Callable[[RunningGraph], LiveView] | None,
) -> int:
    """Wait for the simulation to end; show its progress from its own diagnostics."""
    steps = [0]
    given_up: set[NodeProcess] = set()
    name = f'/{graph.robot}/sim_node'

    def note(message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == name:
                counters = {v.key: v.value for v in status.values}
                if counters.get('steps', '').isdecimal():
                    steps[0] = int(counters['steps'])

    view = None
    arguments = ['--ros-args', '--enclave', graph.enclave('walk')]
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    try:
        node = rclpy.create_node('walk', namespace=f'/{graph.robot}', enable_rosout=False)
        node.create_subscription(DiagnosticArray, '/diagnostics', note, 10)
        live = sys.stderr.isatty()
        if open_view:
            view = open_view(running)
            print(f'see it walk: {view.address}', file=sys.stderr, flush=True)
        while running.exit_code(graph.simulation) is None:
            rclpy.spin_once(node, timeout_sec=0.0 if view else 0.2)
            if view:
                view.spin_once()
            given_up &= {*running.ended()}  # others were started again
            if live:
                print(f'\r{steps[0] / CONTROL_RATE:7.1f} of {options.duration:g} s', end='',
                      file=sys.stderr, flush=True)
            for process in {*running.ended()} - {graph.simulation} - given_up:
                code = running.exit_code(process)
                said = f'\n{process.executable} {" ".join(process.names)} ended with code {code}'
                voxel = process in graph.voxels
                if voxel and respawn and code is not None and code < 0:  # a signal's doing
                    print(f'{said}: started again', file=sys.stderr)
                    running.start_again(process)
                elif voxel and options.real_time_factor:
                    print(f'{said}: the robot goes on without', file=sys.stderr)
                    given_up.add(process)
                else:
                    print(said, file=sys.stderr)
                    return 1
        if live:
            print(f'\r{options.duration:7.1f} of {options.duration:g} s', file=sys.stderr)
        node.destroy_node()
    finally:
        if view:
            view.close()
        rclpy.try_shutdown()
    return 0 if running.exit_code(graph.simulation) == 0 else 1


def _report(bag: Path, offline: np.ndarray, may_differ: bool) -> int:
    report_parser = argparse.ArgumentParser(prog='snca report')
    report.add_arguments(report_parser)
    code = report.run(report_parser.parse_args([str(bag)]), report_parser)
    centers = read_bag(bag).centers
    same = centers.shape == offline.shape and np.array_equal(centers, offline)
    verdict = 'bit for bit the same' if same else 'NOT THE SAME'
    if may_differ and not same and centers.shape == offline.shape:
        parted = np.flatnonzero((centers != offline).any(axis=1))[0]
        verdict = f'the same until step {parted}, when late, lost or dead voxels began to show'
    print(f'offline twin: {len(offline)} positions of the centre, {verdict}')
    return code if same or may_differ else 1
