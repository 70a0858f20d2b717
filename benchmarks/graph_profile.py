"""Shows where the CPU time of graphs of ROS nodes goes: by thread and library, with datagrams.

    python -m benchmarks.graph_profile [--quick] [--json FILE]

10 and 40 voxels in processes of their own walk in lock-step, as in `benchmarks.graph`. CPU time and
context switches of threads come from /proc, datagrams from the counters of the network namespace:
what else uses UDP meanwhile counts, too. In a namespace of its own nothing else does:

    unshare --net sh -c 'ip link set lo up && python -m benchmarks.graph_profile'

A second window is recorded by `perf`, if it is installed and permitted, for the share of each
library. Then the walk is paused, and what is left on the network is discovery and diagnostics.
"""

import multiprocessing
import os
import re
import shutil
import subprocess
import tempfile
import time
from collections import defaultdict
from pathlib import Path

from benchmarks.command import run_part
from benchmarks.floor import n_messages
from benchmarks.graph import Observer, write_controller
from snca_ros.controller_file import load_controller
from snca_ros.graph.description import WalkOptions, describe_graph
from snca_ros.graph.environment import graph_environment
from snca_ros.graph.processes import RunningGraph

SHAPES = ['biped', 'worm-10x4']

_LIMIT = 120.0  # seconds
_SETTLE = 60  # steps before anything is measured
_TICKS = os.sysconf('SC_CLK_TCK')
_SHOWN = 0.01  # of all CPU time: libraries with less are not shown


class Usage:
    """What the threads of some processes have used since an earlier moment.

    Attributes:
        cpu: CPU time by name of the thread [s]: `main`, those of Fast DDS, and `others`.
        switches: context switches by name of the thread.
    """

    def __init__(self, pids: list[int]) -> None:
        self.cpu: defaultdict[str, float] = defaultdict(float)
        self.switches: defaultdict[str, int] = defaultdict(int)
        for pid in pids:
            for thread in Path(f'/proc/{pid}/task').iterdir():
                name, _, fields = (thread / 'stat').read_text().rpartition(') ')
                times = fields.split()[11:13]
                name = name.partition('(')[2]
                if int(thread.name) == pid:
                    name = 'main'
                elif name.startswith('dds.'):
                    name = re.sub(r'[.\d]+$', '', name)  # without port or count
                else:  # it has the name of its process
                    name = 'others'
                status = (thread / 'status').read_text()
                self.cpu[name] += sum(map(int, times)) / _TICKS
                self.switches[name] += sum(
                    map(int, re.findall(r'ctxt_switches:\s*(\d+)', status))
                )

    def since(self, before: 'Usage', steps: int) -> dict[str, dict[str, float]]:
        """Return CPU time [ms] and context switches per step by name of the thread."""
        return {
            name: {
                'cpu_ms': (self.cpu[name] - before.cpu[name]) / steps * 1e3,
                'switches': (self.switches[name] - before.switches[name]) / steps,
            }
            for name in self.cpu
        }


def datagrams() -> int:
    """Return how many UDP datagrams this network namespace has received."""
    names, values = (
        line.split() for line in Path('/proc/net/snmp').read_text().splitlines()
        if line.startswith('Udp:')
    )
    return int(dict(zip(names, values, strict=True))['InDatagrams'])


def shares_of_libraries(pids: list[int], seconds: float) -> dict[str, float]:
    """Return the share of CPU time of each library and of the kernel; empty without `perf`."""
    if not shutil.which('perf'):
        return {}
    with tempfile.TemporaryDirectory() as folder:
        data = f'{folder}/perf.data'
        recorded = subprocess.run(
            ['perf', 'record', '-q', '-F', '499', '-o', data, '-p', ','.join(map(str, pids)),
             '--', 'sleep', str(seconds)],
            check=False, capture_output=True,
        )
        if recorded.returncode:
            return {}
        report = subprocess.run(
            ['perf', 'report', '-i', data, '--sort', 'dso', '--stdio', '-q'],
            check=False, capture_output=True, text=True,
        ).stdout
    found = re.findall(r'^\s*([\d.]+)%\s+(\S+?)(?:\.so|\.cpython|\.abi3|\s)', report, re.MULTILINE)
    return {name: float(percent) / 100 for percent, name in found}


def measure_case(path: Path, seconds: float) -> dict:
    """Return the profile of one graph; see `table` for the units."""
    trained = load_controller(path)
    n, robot = trained.morphology.n_voxels, f'profile_{trained.morphology.n_voxels}'
    graph = describe_graph(path, trained, WalkOptions(robot=robot, duration=0.0))
    with RunningGraph(graph, {}) as running, Observer() as observer:
        assert graph.simulation is not None
        roles = {
            'simulation': [running.pids()[graph.simulation]],
            'voxels': [running.pids()[voxel] for voxel in graph.voxels],
        }
        all_pids = [*roles['simulation'], *roles['voxels']]
        with observer.arrivals(robot, latched=True) as seen:
            observer.spin_until(lambda: seen and seen[-1][1] >= _SETTLE, _LIMIT)
        start, first = observer.next_count(robot)
        before, sent = {role: Usage(pids) for role, pids in roles.items()}, datagrams()
        end, last = start, first
        while end - start < seconds:
            end, last = observer.next_count(robot)
        steps, received = last - first, datagrams() - sent
        threads = {role: Usage(pids).since(before[role], steps) for role, pids in roles.items()}
        libraries = shares_of_libraries(all_pids, seconds)
        pause(observer, robot)
        used, sent = Usage(all_pids), datagrams()
        time.sleep(seconds)
        paused = {
            'datagrams': (datagrams() - sent) / seconds,
            'cpu_ms': sum(x['cpu_ms'] for x in Usage(all_pids).since(used, 1).values()) / seconds,
        }
    return {
        'voxels': n, 'messages': n_messages(trained.morphology),
        'steps_per_second': steps / (end - start), 'threads': threads,
        'datagrams_per_step': received / steps, 'paused_per_second': paused,
        'libraries': libraries,
    }


def pause(observer: Observer, robot: str) -> None:
    """Pause the simulation of a robot."""
    from std_srvs.srv import SetBool

    client = observer.node.create_client(SetBool, f'/{robot}/pause')
    observer.spin_until(client.service_is_ready, _LIMIT)
    answer = client.call_async(SetBool.Request(data=True))
    observer.spin_until(answer.done, _LIMIT)
    observer.node.destroy_client(client)


def measure(quick: bool) -> dict:
    """Measure each graph in a process of its own; return {'graphs': [...]}.

    Args:
        quick: shorter windows.
    """
    os.environ['ROS_DOMAIN_ID'] = str(1 + os.getpid() % 100)
    os.environ.update(graph_environment())
    seconds = 3.0 if quick else 10.0
    spawn = multiprocessing.get_context('spawn')
    with tempfile.TemporaryDirectory() as folder, spawn.Pool(1, maxtasksperchild=1) as alone:
        paths = [write_controller(Path(folder), shape) for shape in SHAPES]
        return {'graphs': [alone.apply(measure_case, (path, seconds)) for path in paths]}


def table(results: dict) -> str:
    """Return the results of `measure` as text."""
    lines = []
    for graph in results['graphs']:
        paused = graph['paused_per_second']
        lines += [
            f'{graph["voxels"]} voxels: {graph["messages"]} messages and '
            f'{graph["datagrams_per_step"]:.1f} datagrams a step; '
            f'{paused["datagrams"]:.0f} datagrams and {paused["cpu_ms"]:.0f} ms of CPU a second '
            'while paused',
            'CPU per step [ms]  context switches per step  threads',
        ]
        for role, threads in graph['threads'].items():
            used = sorted(threads.items(), key=lambda item: -item[1]['cpu_ms'])
            lines += [
                f'{of_one["cpu_ms"]:17.3f}{of_one["switches"]:27.1f}  {role}: {name}'
                for name, of_one in used
            ]
        shares = [f'{name} {100 * x:.0f} %' for name, x in graph['libraries'].items() if x > _SHOWN]
        lines += [f'perf: {", ".join(shares) or "not available"}', '']
    return '\n'.join(lines)


if __name__ == '__main__':
    run_part(__doc__, measure, table)
