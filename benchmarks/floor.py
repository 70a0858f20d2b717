"""Measures the lock-step of robots over bare UDP sockets: the floor of what their graphs can cost.

    python -m benchmarks.floor [--quick] [--json FILE]

A process for each voxel and one for the simulation exchange as many datagrams as the graph of ROS
nodes, with the sizes of its messages and in its order, but without ROS and without computing
anything: what remains is the kernel and a few lines of Python.
"""

import os
import socket
import statistics
import struct
import time
from collections import Counter

from benchmarks.command import run_part
from sim_node import message_layout
from sim_node.control_time import CONTROL_RATE, steps_in
from sim_node.episode import EXAMPLE_EPISODE
from sim_node.model.morphology import Morphology, parse_morphology
from sim_node.model.sensors import DEFAULT_SENSORS
from sim_node.ros.deadlines import Pace
from snca_ros.cell.architecture import Architecture

CASES = ['worm', 'biped', 'worm-10x2', 'worm-10x4']
QUICK = ['biped', 'worm-10x4']

_STEPS = 1500
_LIMIT = 30  # seconds without a datagram after which a process gives up
_LONGEST = 1024  # bytes
_STEP = struct.Struct('<q')  # leads each datagram: the step that needs it

Address = tuple[str, int]


def n_messages(morphology: Morphology) -> int:
    """Return the messages that a control step of a robot needs: sensors, actuation, links."""
    return 2 * morphology.n_voxels + int((morphology.neighbors >= 0).sum())


def _payloads(morphology: Morphology) -> tuple[bytes, bytes, bytes]:
    """Return zeros that are as long as sensors, actuation and cell messages after their step."""
    voxel, cell = morphology.voxel_names[0], Architecture.named('U-nD', 'snn-h')
    n_bytes = cell.n_destinations * cell.n_c * cell.message_width
    sensors, actuation, message = (
        bytes(layout.itemsize - _STEP.size) for layout in (
            message_layout.joint_state(voxel, EXAMPLE_EPISODE, DEFAULT_SENSORS, 0),
            message_layout.joint_state(voxel, EXAMPLE_EPISODE, [voxel], 0),
            message_layout.image(voxel, EXAMPLE_EPISODE, 'mono8', n_bytes),
        )
    )
    return sensors, actuation, message


def _bound_socket() -> socket.socket:
    """Return a UDP socket with a port of its own on the loopback interface."""
    own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    # Python's own timeout would cost a system call for each datagram.
    own.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, struct.pack('ll', _LIMIT, 0))
    own.bind(('127.0.0.1', 0))
    return own


def _run_voxel(
    own: socket.socket, simulation: Address, neighbors: list[Address], message: bytes,
    actuation: bytes, n_steps: int,
) -> None:
    """Answer each sensors(k) as soon as all messages(k - 1) are there."""
    arrived: Counter[int] = Counter()  # datagrams by the step that needs them
    for step in range(n_steps):
        needed = 1 + (len(neighbors) if step else 0)
        while arrived[step] < needed:
            arrived[_STEP.unpack_from(own.recv(_LONGEST))[0]] += 1
        del arrived[step]
        datagram = _STEP.pack(step + 1) + message
        for neighbor in neighbors:
            own.sendto(datagram, neighbor)
        own.sendto(_STEP.pack(step) + actuation, simulation)


def _run_simulation(
    own: socket.socket, voxels: list[Address], sensors: bytes, n_steps: int, pace: Pace | None
) -> None:
    """Send sensors(k) to all voxels, and sensors(k + 1) as soon as all have answered.

    With a `pace`, wait for the deadline of each step, too; it counts the missed ones.
    """
    if pace:
        pace.start(0, time.monotonic())
    for step in range(n_steps):
        if pace:
            time.sleep(max(0.0, pace.due(step) - time.monotonic()))
            pace.note(step, time.monotonic())
        datagram = _STEP.pack(step) + sensors
        for voxel in voxels:
            own.sendto(datagram, voxel)
        for _ in voxels:
            own.recv(_LONGEST)


def measure_case(shape: str, seconds: float = 0.0) -> dict:
    """Return rate and CPU time per step of one robot; see `table` for the units.

    Args:
        shape: of the robot.
        seconds: how long to run at 60 steps a second, which counts missed deadlines, too; 0 for
            as fast as possible.
    """
    pace = Pace(CONTROL_RATE) if seconds else None
    n_steps = steps_in(seconds) if seconds else _STEPS
    morphology = parse_morphology(shape)
    sensors, actuation, message = _payloads(morphology)
    simulation, *voxels = (_bound_socket() for _ in range(morphology.n_voxels + 1))
    address, *addresses = (own.getsockname() for own in (simulation, *voxels))
    children, each = [], []
    try:
        for own, places in zip(voxels, morphology.neighbors, strict=True):
            child = os.fork()
            if not child:
                try:
                    neighbors = [addresses[i] for i in places if i >= 0]
                    _run_voxel(own, address, neighbors, message, actuation, n_steps)
                finally:
                    os._exit(0)
            children.append(child)
        wall, cpu = time.monotonic(), time.process_time()
        _run_simulation(simulation, addresses, sensors, n_steps, pace)
        wall, cpu = time.monotonic() - wall, time.process_time() - cpu
    finally:
        for child in children:
            used = os.wait4(child, 0)[2]
            each.append(used.ru_utime + used.ru_stime)
        for own in (simulation, *voxels):
            own.close()
    return {
        'shape': shape, 'voxels': morphology.n_voxels, 'messages': n_messages(morphology),
        'real_time_factor': n_steps / wall / CONTROL_RATE,
        'missed_deadlines': pace.missed if pace else None,
        'cpu_ms_per_step': {
            'all': (cpu + sum(each)) / n_steps * 1e3, 'simulation': cpu / n_steps * 1e3,
            'each_voxel': statistics.mean(each) / n_steps * 1e3,
        },
    }


def measure(quick: bool) -> dict:
    """Measure each robot; return {'robots': [...]}.

    Args:
        quick: fewer robots.
    """
    return {'robots': [measure_case(shape) for shape in (QUICK if quick else CASES)]}


def table(results: dict) -> str:
    """Return the results of `measure` as text."""
    lines = [
        'voxels  messages  x real time   CPU per step [ms]: all  simulation   each   '
        'CPU per message [us]'
    ]
    for robot in results['robots']:
        cpu = robot['cpu_ms_per_step']
        lines.append(
            f'{robot["voxels"]:6}{robot["messages"]:10}{robot["real_time_factor"]:13.1f}'
            f'{cpu["all"]:25.2f}{cpu["simulation"]:12.2f}{cpu["each_voxel"]:7.3f}'
            f'{cpu["all"] / robot["messages"] * 1e3:23.1f}'
        )
    return '\n'.join(lines)


if __name__ == '__main__':
    run_part(__doc__, measure, table)
