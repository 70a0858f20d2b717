"""Measures what walks in real time promise in seconds, which tests do not assert.

    python -m benchmarks.real_time [--quick] [--json FILE]

The bundled biped, ten voxels in ten processes, walks at 1 and 2 times real time: the rate that it
keeps, the CPU time that all processes together use of one core, the deadlines that it misses, and
the wall time from `kill -9` of a voxel until the simulation's diagnostics name it, also in
lock-step, where the simulation says which voxel it waits for. At real time it walks for ten
minutes, and beside it runs its floor, see `benchmarks.floor`.
"""

import multiprocessing
import os
import time

from benchmarks import floor
from benchmarks.command import run_part
from benchmarks.graph import Observer, cpu_seconds
from sim_node.control_time import CONTROL_RATE
from snca_ros.bundled import DEFAULT_CONTROLLER, find_controller
from snca_ros.controller_file import load_controller
from snca_ros.graph.description import WalkOptions, describe_graph
from snca_ros.graph.environment import graph_environment
from snca_ros.graph.processes import RunningGraph

FACTORS = (1.0, 2.0, 0.0)  # times real time; 0 for lock-step
_LONG, _SHORT, _QUICK = 600.0, 20.0, 4.0  # seconds at real time, otherwise, and with --quick
_LIMIT = 120.0  # seconds
_SETTLE = 60  # steps before anything is measured


def measure_case(factor: float, seconds: float) -> dict:
    """Return rate, CPU time, missed deadlines and the time until a killed voxel is named."""
    robot, path = f'robot_{round(10 * factor)}', find_controller(DEFAULT_CONTROLLER)
    graph = describe_graph(
        path, load_controller(path), WalkOptions(robot, duration=0.0, real_time_factor=factor)
    )
    name, victim = f'/{robot}/sim_node', graph.voxels[0]
    with RunningGraph(graph, {}) as running, Observer() as observer:
        with observer.newest_step(robot) as newest:
            observer.spin_until(lambda: newest[0] >= _SETTLE, _LIMIT)
        begin, first = end, last = observer.next_count(robot)
        before = _counts(observer, running, name)
        while end - begin < seconds:
            end, last = observer.next_count(robot)
        cpu, missed = (a - b for a, b in zip(_counts(observer, running, name), before, strict=True))
        running.kill(victim)
        killed = time.monotonic()
        observer.spin_until(lambda: victim.name in observer.health[name][0], _LIMIT)
        named = time.monotonic() - killed
    rate = (last - first) / (end - begin)
    return {
        'factor': factor, 'steps_per_second': rate,
        'kept': rate / (CONTROL_RATE * factor) if factor else None,
        'seconds': end - begin, 'share_of_core': cpu / (end - begin),
        'missed_deadlines': int(missed), 'seconds_until_named': named,
    }


def _counts(observer: Observer, running: RunningGraph, name: str) -> tuple[float, float]:
    """Return the CPU time of all processes [s], and the simulation's missed deadlines."""
    cpu = sum(map(cpu_seconds, running.pids().values()))
    return cpu, float(observer.health[name][1].get('missed deadlines', '0'))


def measure(quick: bool) -> dict:
    """Measure each factor in a process of its own; return {'walks': [...], 'floor': {...}}."""
    os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % 100)
    os.environ.update(graph_environment())
    spawn = multiprocessing.get_context('spawn')
    with spawn.Pool(2, maxtasksperchild=1) as alone:
        first = _QUICK if quick else _LONG
        beside = alone.apply_async(floor.measure_case, ('biped', first))
        walks = [alone.apply(measure_case, (FACTORS[0], first))]
        floor_of_it = beside.get()
        seconds = _QUICK if quick else _SHORT
        walks += [alone.apply(measure_case, (factor, seconds)) for factor in FACTORS[1:]]
    return {'walks': walks, 'floor': floor_of_it}


def table(results: dict) -> str:
    """Return the results of `measure` as text."""
    head = 'steps/s   kept  of one core  missed deadlines  seconds until a killed voxel is named'
    lines = [f'  x real time   {head}']
    for walk in results['walks']:
        factor = f'{walk["factor"]:g}' if walk['factor'] else 'lock-step'
        kept = '-' if walk['kept'] is None else f'{walk["kept"]:.3f}'
        missed = walk['missed_deadlines'] if walk['factor'] else '-'
        lines.append(
            f'{factor:>13}{walk["steps_per_second"]:10.1f}{kept:>7}{walk["share_of_core"]:13.1%}'
            f'{missed:>18}{walk["seconds_until_named"]:39.2f}'
        )
    beside, seconds = results['floor'], results['walks'][0]['seconds']
    share = beside['cpu_ms_per_step']['all'] * CONTROL_RATE / 1e3
    lines.append(
        f'{"floor":>13}{"":17}{share:13.1%}{beside["missed_deadlines"]:18}   beside the first, '
        f'which took {seconds:.0f} s'
    )
    return '\n'.join(lines)


if __name__ == '__main__':
    run_part(__doc__, measure, table)
