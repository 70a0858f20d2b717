"""(ROS) The `walk` command: starts a robot's nodes, supervises and stops them, and reports."""

import argparse
import re
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import ExitStack
from datetime import datetime
from functools import partial
from pathlib import Path

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.errors import InvalidInput
from sim_node.model.constants import help_of
from sim_node.ros import security
from sim_node.ros.domain import check_domain
from sim_node.ros.sim_interface import BodyOptions
from snca_ros.bundled import DEFAULT_CONTROLLER, find_controller
from snca_ros.command_line import FormerlyWithValue
from snca_ros.commands.body_options import add_body_options, load_in_body
from snca_ros.commands.declared_options import add_option
from snca_ros.commands.json_output import add_json_option
from snca_ros.commands.report import print_report, print_task
from snca_ros.evolution.episode import run_episode
from snca_ros.faults import FAULTS_HELP, Faults, parse_faults
from snca_ros.files import BAGS
from snca_ros.firmware.boards import BOARDS
from snca_ros.firmware.build import build_devices, parse_boards, parse_devices
from snca_ros.firmware.lines import EXPECTED
from snca_ros.graph.description import Graph, WalkOptions, describe_graph, robot_name
from snca_ros.graph.environment import graph_environment
from snca_ros.graph.fork_server import ForkServer
from snca_ros.graph.live_view import LiveView
from snca_ros.graph.lookout import Lookout
from snca_ros.graph.processes import RunningGraph, start_server
from snca_ros.graph.supervisor import supervise_walk
from snca_ros.interrupts import INTERRUPTED, exiting_at_interrupt
from snca_ros.nodes.interfaces import ViewOptions
from snca_ros.recording.bag import read_bag
from snca_ros.recording.gait import measure_gait
from snca_ros.recording.offline import compare_with_twin
from snca_ros.recording.report import as_dict
from snca_ros.trained_controller import TrainedController
from snca_ros.web.server import check_port

EXAMPLES = """
  snca walk                                         # the bundled biped, 30 s, in lock-step
  snca walk runs/tripod/best.npz --terrain hilly-1-10-0 --duration 60
  snca walk --real-time --respawn                   # at 60 Hz; killed voxels are restarted
  snca walk --real-time --reliability best_effort   # what a cable loses is not sent again
  snca walk --view                                  # a live page; click voxels to kill them
  snca walk --faults loss=0.3,death=0.5@10,seed=3   # lost messages; half the voxels die at 10 s
  snca walk --engine batched --bag bags/mine --storage sqlite3
  snca walk --shape tripod --without voxel_1_1      # the biped's cell in another, damaged body
  snca walk --devices emulated:microbit --arithmetic int16   # each cell on its own micro:bit
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `walk`."""
    parser.add_argument('controller', nargs='?', default=DEFAULT_CONTROLLER,
                        help='controller file, or the name of a bundled one '
                        f'(default {DEFAULT_CONTROLLER})')
    add_option(parser, WalkOptions, 'duration')
    parser.add_argument('--real-time', action=FormerlyWithValue, own_option='--real-time-factor',
                        is_value=_is_number, help='run in real time and do not wait for voxels '
                        '(default: lock-step, as fast as possible)')
    add_option(parser, WalkOptions, 'real_time_factor', default=None, metavar='FACTOR')
    add_option(parser, WalkOptions, 'reliability')
    parser.add_argument('--respawn', action='store_true',
                        help='restart voxels that were killed')
    parser.add_argument('--terrain', default='', help='terrain (default: that of its evolution)')
    add_option(parser, BodyOptions, 'engine')
    add_body_options(parser)
    parser.add_argument('--robot', default='', help='namespace (default: the shape)')
    add_option(parser, WalkOptions, 'voxels_per_process', metavar='K')
    add_option(parser, WalkOptions, 'arithmetic')
    parser.add_argument('--device', action='append', default=[], metavar='VOXEL=ADDRESS',
                        help=f'device that the cell of a voxel is on: {EXPECTED}; one option per '
                        'voxel')
    parser.add_argument('--devices', default='', metavar='emulated:BOARD,...',
                        help='build firmware and run each cell on an emulated board: '
                        f'{", ".join(BOARDS)}; voxels take several boards in turn')
    parser.add_argument('--faults', default='', metavar='SPEC', help=FAULTS_HELP)
    parser.add_argument('--only', default='', metavar='VOXELS',
                        help='voxels to run, if `snca voxels` runs the others elsewhere: '
                        'K/N, the Kth of N shares, or voxel_0_0,voxel_1_0,..., or none')
    parser.add_argument('--view', action=FormerlyWithValue, own_option='--port',
                        is_value=_is_number, help='show the walk live on a web page of this '
                        'machine, in real time unless --real-time-factor is given')
    add_option(parser, ViewOptions, 'port', default=None, metavar='PORT',
               help=f'{help_of(ViewOptions, "port")}; implies --view')
    record = parser.add_mutually_exclusive_group()
    record.add_argument('--bag', type=Path, help=f'bag to write (default {BAGS}/<robot>-<time>)')
    record.add_argument('--no-bag', action='store_true', help='record nothing')
    add_option(parser, WalkOptions, 'storage')
    add_json_option(parser)


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Run a walk and report on it; return the exit code."""
    check_domain()
    security.check_middleware()
    path = find_controller(args.controller)
    with ExitStack() as stack:
        file, trained = load_in_body(path, args.shape, args.without, stack)
        trained = trained.in_arithmetic(args.arithmetic)
        return _run(args, file, trained, _devices(args, trained, path.stem, stack))


def _devices(
    args: argparse.Namespace, trained: TrainedController, name: str, stack: ExitStack
) -> dict[str, str]:
    """Return the addresses of the voxels' devices; build firmware that `stack` removes."""
    given = parse_devices(args.device, trained.morphology)
    if not args.devices:
        return given
    boards = parse_boards(args.devices)
    place = stack.enter_context(tempfile.TemporaryDirectory(prefix='snca_ros_'))
    return {**build_devices(trained, boards, Path(place, 'firmware'), name), **given}


def _run(
    args: argparse.Namespace, path: Path, trained: TrainedController, devices: dict[str, str]
) -> int:
    if args.json and args.no_bag:
        raise InvalidInput('--json', args.json, 'a walk with a bag, whose report it is')
    if args.duration < 1 / CONTROL_RATE:
        raise InvalidInput('--duration', args.duration, 'at least one control step, 1/60 s')
    port = ViewOptions.port if args.view and args.port is None else args.port
    if port is not None:
        check_port(port)
    factor = args.real_time_factor or float(args.real_time or port is not None)
    robot = args.robot or robot_name(trained.morphology)
    bag = args.bag or BAGS / f'{robot}-{datetime.now():%Y%m%d-%H%M%S}'
    engine = args.engine
    faults = parse_faults(args.faults)
    options = WalkOptions(
        robot, args.terrain, engine, args.duration, factor, args.voxels_per_process,
        only=args.only, bag='' if args.no_bag else str(bag), storage=args.storage, faults=faults,
        simulation={} if port is None else {'recorders': 2 - args.no_bag},
        arithmetic=args.arithmetic, devices=devices, reliability=args.reliability,
    )
    graph = describe_graph(path, trained, options)
    open_view = None
    if port is not None:
        open_view = partial(
            LiveView, port, trained, args.terrain or trained.terrain, args.reliability
        )
    lookout = Lookout(robot, graph.enclave('walk'), options.reach)
    with start_server(graph, graph_environment(options.reach)) as server:
        with exiting_at_interrupt():
            offline = _offline_centers(
                trained, args.terrain or trained.terrain, engine, args.duration, faults
            )
            lookout.check()
        code = _walk(graph, options, args.respawn, open_view, server)
    if code or args.no_bag:
        return code
    recording = read_bag(bag)
    gait = measure_gait(recording)
    print_report(recording, gait)
    task = print_task(recording, trained)
    may_differ = args.respawn or factor > 0.0
    text, as_expected = compare_with_twin(recording.centers, offline, may_differ)
    print(text)
    args.write_json({
        **as_dict(recording, gait), 'task': task, 'offline_twin': text, 'as_expected': as_expected,
    })
    return 0 if as_expected else 1


def _is_number(text: str) -> bool:
    return re.fullmatch(r'\d*\.?\d+', text, re.ASCII) is not None


def _offline_centers(
    trained: TrainedController, terrain: str, engine: str, duration: float, faults: Faults
) -> np.ndarray:
    simulation = trained.simulation(terrain, engine, faults=faults)
    controller = trained.controller(faults)
    print('running the offline episode for comparison', file=sys.stderr, flush=True)
    return run_episode(simulation, controller, duration).centers


def _walk(
    graph: Graph, options: WalkOptions, respawn: bool,
    open_view: Callable[[RunningGraph], LiveView] | None, server: ForkServer,
) -> int:
    """Run the graph until the simulation is done; return the exit code."""
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    started = time.monotonic()
    n = sum(len(p.names) for p in graph.voxels)
    print(
        f'/{graph.robot}: {n} voxels in {len(graph.voxels)} processes, one simulation'
        f'{", one recorder" if graph.recorder else ""}', file=sys.stderr,
    )
    try:
        code = supervise_walk(graph, options, respawn, open_view, server)
    except KeyboardInterrupt:
        print('\nstopped', file=sys.stderr)
        return INTERRUPTED
    if code == 0:
        taken = time.monotonic() - started
        print(f'walked {options.duration:g} s in {taken:.1f} s, start included', file=sys.stderr)
    return code
