"""Runs a long walk in lock-step with random kills, and checks for leaks and missing messages.

    python -m benchmarks.soak [--minutes M] [--shape SHAPE] [--kill-every S] [--seed N]

The walk of M minutes of simulated time runs as fast as possible and is recorded. At random moments
a random voxel is killed (kill -9) and restarted. Afterwards every message that a step needs must be
in the bag, except for the last answer of a killed voxel, if the simulation had it; memory and file
descriptors of the processes that were not killed must not have grown. Otherwise the exit code is 1.
"""

import argparse
import json
import math
import os
import signal
import struct
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import Reader

from benchmarks.graph import Observer, memory, write_controller
from sim_node.control_time import step_of_stamp, steps_in
from sim_node.model.morphology import parse_morphology
from snca_ros.controller_file import load_controller
from snca_ros.graph.description import Graph, WalkOptions, describe_graph
from snca_ros.graph.environment import graph_environment
from snca_ros.graph.processes import RunningGraph

_ROBOT = 'soak'
_LIMIT = 120.0  # seconds for a step at most
_SAMPLE_PERIOD = 2.0
_STANDSTILL = 0.5  # seconds after a kill until nobody makes a step any more
_WARM = 0.25  # share of the samples before memory must have settled
_GROWTH = 0.05  # share of its memory by which a process may grow after that
_STAMP = struct.Struct('<4xiI')  # behind the head of a serialised message


def walk(path: Path, bag: Path, minutes: float, kill_every: float, seed: int) -> dict:
    """Run the walk; return kills, samples of memory, and the time taken."""
    options = WalkOptions(
        robot=_ROBOT, duration=60.0 * minutes, bag=str(bag),
        simulation={'silence_limit': _LIMIT, 'start_limit': _LIMIT},
    )
    graph = describe_graph(path, load_controller(path), options)
    assert graph.simulation is not None
    rng = np.random.default_rng(seed)
    begin = time.monotonic()
    with RunningGraph(graph, {}) as running, Observer() as observer:
        with observer.newest_step(_ROBOT) as newest:
            observer.spin_until(lambda: newest[0] > 2, _LIMIT)
            kills, samples = _disturb(graph, running, observer, newest, kill_every, rng)
        code = running.wait(graph.simulation, _LIMIT)
    return {'code': code, 'kills': kills, 'samples': samples, 'seconds': time.monotonic() - begin}


def _disturb(
    graph: Graph, running: RunningGraph, observer: Observer, newest: list[int],
    kill_every: float, rng: np.random.Generator,
) -> tuple[list[dict], list[dict]]:
    """Kill and restart voxels until the simulation ends; return the kills and memory samples."""
    kills: list[dict] = []
    samples: list[dict] = []
    next_sample, simulation = time.monotonic(), graph.simulation
    assert simulation is not None

    def pause(seconds: float) -> None:
        until = time.monotonic() + seconds
        observer.spin_until(lambda: over() or time.monotonic() > until, math.inf)

    def over() -> bool:
        nonlocal next_sample
        if time.monotonic() >= next_sample:
            samples.append(_sample(graph, running))
            next_sample += _SAMPLE_PERIOD
        return running.exit_code(simulation) is not None

    while True:
        pause(rng.uniform(0.0, 2.0 * kill_every))
        if over():
            return kills, samples
        victim = graph.voxels[rng.integers(len(graph.voxels))]
        os.kill(running.pids()[victim], signal.SIGKILL)
        running.wait(victim, _LIMIT)
        pause(_STANDSTILL)
        reached, begin = newest[0], time.monotonic()
        running.start_again(victim)
        observer.spin_until(partial(lambda step: over() or newest[0] > step, reached), _LIMIT)
        kills.append({'voxel': victim.names[0], 'step': reached,
                      'back_after': time.monotonic() - begin})


def _sample(graph: Graph, running: RunningGraph) -> dict[str, tuple[float, int]]:
    """Return (RSS [MB], open files) of each process that is never killed."""
    pids = {process.executable: running.pids()[process] for process in graph.processes
            if process not in graph.voxels}
    return {
        name: (memory(pid)[0], len(os.listdir(f'/proc/{pid}/fd')))
        for name, pid in {**pids, 'soak': os.getpid()}.items()
    }


def count_steps(bag: Path, n_steps: int) -> dict[str, np.ndarray]:
    """Return how many messages of each step the bag has, (n_steps + 1,), by topic.

    Only of topics that say something at every step. The bag is read message by message.
    """
    counts: dict[str, np.ndarray] = {}
    with Reader(bag) as reader:
        for connection, _, data in reader.messages():
            kind = connection.topic.rpartition('/')[2]
            if kind in ('sensors', 'actuation', 'spikes', 'odometry', 'clock'):
                mine = counts.setdefault(connection.topic, np.zeros(n_steps + 1, dtype=int))
                mine[step_of_stamp(*_STAMP.unpack_from(data))] += 1
    return counts


def account(counts: dict[str, np.ndarray], names: tuple[str, ...], kills: list[dict]) -> dict:
    """Return how many messages arrived, arrived twice, were lost by a kill, and are missing.

    Args:
        counts: as from `count_steps`.
        names: of the voxels.
        kills: as from `walk`. After one the graph stands still at a step: the victim's answer of
            the step before may have reached the simulation alone. Later ones are sent again.
    """
    expected = {'/clock': 0, f'/{_ROBOT}/odometry': 0}  # topic: steps at the end without a word
    for name in names:
        expected |= {f'/{_ROBOT}/{name}/{k}': 1 for k in ('sensors', 'actuation', 'spikes')}
    result = {'messages': 0, 'twice': 0, 'killed': 0, 'vanished': 0}
    for topic, silent in expected.items():
        got = counts.get(topic, np.zeros(1, dtype=int))
        missing = np.flatnonzero(got[: len(got) - silent] == 0)
        explained = {
            kill['step'] - 1 for kill in kills if topic == f'/{_ROBOT}/{kill["voxel"]}/actuation'
        }
        lost = len(explained & set(missing.tolist()))
        result['messages'] += int(got.sum())
        result['twice'] += int((got > 1).sum())
        result['killed'] += lost
        result['vanished'] += len(missing) - lost
    return result


def growth(samples: list[dict]) -> dict[str, dict]:
    """Return for each process its memory [MB] and open files after the start and at the end."""
    first = int(_WARM * len(samples))
    return {
        name: {
            'mb': [samples[first][name][0], samples[-1][name][0]],
            'files': [samples[first][name][1], max(s[name][1] for s in samples[first:])],
        }
        for name in samples[0]
    }


def soak(shape: str, minutes: float, kill_every: float, seed: int) -> dict:
    """Run one soak test in a separate ROS domain; return its results."""
    os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % 100)
    os.environ.update(graph_environment())
    with tempfile.TemporaryDirectory() as folder:
        bag = Path(folder) / 'bag'
        result = walk(write_controller(Path(folder), shape), bag, minutes, kill_every, seed)
        names = parse_morphology(shape).voxel_names
        n_steps = steps_in(60.0 * minutes)
        result['messages'] = account(count_steps(bag, n_steps), names, result['kills'])
    result['processes'] = growth(result.pop('samples'))
    flat = all(
        p['mb'][1] <= (1.0 + _GROWTH) * p['mb'][0] and p['files'][1] <= p['files'][0]
        for p in result['processes'].values()
    )
    result |= {'shape': shape, 'minutes': minutes, 'seed': seed, 'flat': flat}
    result['passed'] = flat and not result['messages']['vanished'] and result['code'] == 0
    return result


def table(result: dict) -> str:
    """Return the result of `soak` as text."""
    back = [kill['back_after'] for kill in result['kills']] or [math.nan]
    m = result['messages']
    lines = [
        f'{result["shape"]}: {result["minutes"]:g} min of simulated time in '
        f'{result["seconds"] / 60.0:.1f} min, seed {result["seed"]}',
        f'{len(result["kills"])} kills; a voxel acts again {np.median(back):.1f} s after its '
        f'start (median; at most {max(back):.1f} s)',
        f'{m["messages"]} messages in the bag, {m["twice"]} of them said twice; '
        f'{m["killed"]} lost by a kill, {m["vanished"]} vanished',
        f'{"":14}{"RSS [MB]":>18}{"open files":>14}',
    ]
    for name, p in result['processes'].items():
        lines.append(f'{name:14}{p["mb"][0]:8.1f} → {p["mb"][1]:7.1f}'
                     f'{p["files"][0]:7} → {p["files"][1]:4}')
    lines.append('flat, and nothing unaccounted for' if result['passed'] else 'FAILED')
    return '\n'.join(lines)


def main() -> int:
    """Run the soak test of the command line; return the exit code."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument('--minutes', type=float, default=30.0, help='of simulated time')
    parser.add_argument('--shape', default='worm')
    parser.add_argument('--kill-every', type=float, default=10.0, metavar='S',
                        help='mean wall time between kills [s]')
    parser.add_argument('--seed', type=int, default=0)
    parser.add_argument('--json', type=Path, metavar='FILE', help='also write the figures here')
    args = parser.parse_args()
    result = soak(args.shape, args.minutes, args.kill_every, args.seed)
    print(table(result), flush=True)
    if args.json:
        args.json.write_text(json.dumps(result, indent=1))
    return 0 if result['passed'] else 1


if __name__ == '__main__':
    sys.exit(main())
