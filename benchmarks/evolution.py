"""Measures the cost of evolution besides its episodes: episodes/s in both engines, memory.

    python -m benchmarks.evolution [--quick] [--json FILE]

It compares the wall-clock time of runs of `evolve` with that of episodes run one after another in
this process, and needs two idle cores. The parent's share is its CPU time over that of all
processes.
"""

import multiprocessing
import resource
import tempfile
import time
from pathlib import Path

import numpy as np

from benchmarks.command import run_part
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evaluator import Evaluator, evaluate
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.workers import local_workers


def config_of(episodes: int, duration: float, engine: str = 'pymunk') -> RunConfig:
    """Return the configuration of a run of the biped SNCA."""
    return RunConfig(
        'biped', Architecture.named('U-nD', 'snn-h'), engine=engine,
        episodes=episodes, duration=duration, transient=duration / 6.0,
    )


def cpu_seconds(who: int) -> float:
    """Return the user and system time of this process, or of its children that have ended."""
    usage = resource.getrusage(who)
    return usage.ru_utime + usage.ru_stime


def episodes_alone(config: RunConfig) -> float:
    """Return episodes/s of one generation's candidates, run one after another in this process."""
    evaluator = Evaluator(config)
    candidates = np.random.default_rng(0).uniform(-1.0, 1.0, (36, config.n_parameters))
    evaluator(candidates[:1])
    start = time.perf_counter()
    evaluator(candidates)
    return len(candidates) / (time.perf_counter() - start)


def run_evolution(config: RunConfig, n_workers: int) -> dict:
    """Run `evolve` in a temporary folder; the start of the workers is not measured."""
    times = []
    with tempfile.TemporaryDirectory() as folder:
        run = RunFolder.create(Path(folder) / 'run', config)
        own, children = cpu_seconds(resource.RUSAGE_SELF), cpu_seconds(resource.RUSAGE_CHILDREN)
        start = time.perf_counter()
        with local_workers(n_workers) as workers:
            evolve(run, workers, lambda progress: times.append(time.perf_counter()))
        whole = time.perf_counter() - start
        run.close()
    own = cpu_seconds(resource.RUSAGE_SELF) - own
    children = cpu_seconds(resource.RUSAGE_CHILDREN) - children
    return {
        'engine': config.engine,
        'workers': n_workers,
        # From the end of the first generation: what a long run sees.
        'evaluations_per_second': config.population * (len(times) - 1) / (times[-1] - times[0]),
        'parent_share_of_cpu': own / (own + children),
        'start_seconds': whole - (times[-1] - times[0]) / (len(times) - 1) * len(times),
    }


def memory(episodes: int) -> list[dict]:
    """Return the resident memory [MB] of parent and worker during a run."""
    config = config_of(episodes, 0.5)
    rng, seen = np.random.default_rng(0), []
    with local_workers(1) as workers:
        done, every = 0, max(episodes // 10, 36)
        while done < episodes:
            n = min(every, episodes - done)
            list(evaluate(workers, config, rng.uniform(-1.0, 1.0, (n, config.n_parameters))))
            done += n
            megabytes = [
                resident(process.pid)
                for process in multiprocessing.active_children() if process.pid
            ]
            seen.append({'episodes': done, 'megabytes': megabytes})
    return seen


def resident(pid: int) -> float:
    """Return the resident memory [MB] of a process."""
    pages = int(Path(f'/proc/{pid}/statm').read_text().split()[1])
    return pages * resource.getpagesize() / 1e6


def measure(quick: bool) -> dict:
    """Measure one and two workers, alternately, and the memory of a long run."""
    generations, duration = (4, 5.0) if quick else (9, 30.0)
    config = config_of(36 * generations, duration)
    batched = config_of(36 * generations * 6, duration, 'batched')
    return {
        'duration': duration,
        'episodes_per_second': episodes_alone(config),
        'runs': [run_evolution(*run) for run in ((config, 1), (config, 2), (batched, 2))],
        'memory': memory(1000 if quick else 10_000),
    }


def table(results: dict) -> str:
    """Return the measurements as text."""
    alone, runs = results['episodes_per_second'], results['runs']
    lines = [
        f'Episodes of {results["duration"]:g} s, biped U-nD snn-h',
        'workers  of episodes alone  of one worker  parent share of CPU  episodes/s  '
        'start [s]  engine',
    ]
    for run in runs:
        rate = run['evaluations_per_second']
        lines.append(
            f'{run["workers"]:7d}{rate / alone / run["workers"]:19.3f}'
            f'{rate / runs[0]["evaluations_per_second"]:15.2f}{run["parent_share_of_cpu"]:21.4f}'
            f'{rate:15.1f}{run["start_seconds"]:11.1f}  {run["engine"]}'
        )
    first, last = results['memory'][1], results['memory'][-1]
    grown = last['megabytes'][0] - first['megabytes'][0]
    lines.append(
        f'memory of a worker: {grown:+.1f} MB from evaluation {first["episodes"]} to '
        f'{last["episodes"]}, {last["megabytes"][0]:.0f} MB then'
    )
    return '\n'.join(lines)


if __name__ == '__main__':
    run_part(__doc__, measure, table)
