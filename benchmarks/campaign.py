"""Measures the cost of the paper's campaigns: rates of each case, time on 2 to 1,000 cores.

    python -m benchmarks.campaign [--quick] [--json FILE]

One run of each case evolves in this process for some time, as in a worker of `campaign`, and is
assessed. Rates are episodes per second of CPU time, after the first third, when robots begin to
walk. Core-hours of evolution and of assessment are listed separately.
"""

import heapq
import tempfile
import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path

from benchmarks.command import run_part
from snca_ros.campaign.endpoints import perform
from snca_ros.campaign.specification import read_campaign
from snca_ros.comparison.runs import ControllerType
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.workers import IN_PROCESS

EXPERIMENTS = Path(__file__).parents[1] / 'config' / 'experiments'
CORES = 2, 64, 1000


def case_of(config: RunConfig) -> str:
    """Return the settings that the runs of a case have in common."""
    cell = config.architecture
    return f'{config.shape} {ControllerType(cell.name, cell.neuron_model)}'


def measure_run(config: RunConfig, generations: int) -> tuple[float, float]:
    """Return episodes per second of CPU time of a run, and CPU seconds of its assessment."""
    marks: list[tuple[float, int]] = []
    short = replace(config, episodes=generations * config.population)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / 'run'
        run = RunFolder.create(path, short)
        evolve(run, IN_PROCESS, lambda p: marks.append((time.process_time(), p.episodes)))
        run.close()
        finished = time.process_time()
        perform(short, path)  # it finds the run evolved, and assesses it
        assessment = time.process_time() - finished
    (start, before), (end, after) = marks[generations // 3 - 1], marks[-1]
    return (after - before) / (end - start), assessment


def makespan(durations: Iterable[float], cores: int) -> float:
    """Return the end of the last run, if each begins as soon as a core is free."""
    busy = [0.0] * cores
    for duration in durations:
        heapq.heapreplace(busy, busy[0] + duration)
    return max(busy)


def measure(quick: bool) -> dict:
    """Measure every case of both campaigns; the second one without the runs of the first."""
    main, supplement = (read_campaign(EXPERIMENTS / f'paper-{name}.yaml')
                        for name in ('main', 'supplement'))
    shared = {config.name for config in main}
    campaigns = {
        'paper-main': main,
        'the rest of paper-supplement': [c for c in supplement if c.name not in shared],
    }
    cases = {case_of(config): config for configs in campaigns.values() for config in configs}
    measured = {case: measure_run(config, 9 if quick else 30) for case, config in cases.items()}
    rates = {case: of_evolution for case, (of_evolution, _) in measured.items()}
    assessments = {
        name: sum(measured[case_of(config)][1] for config in configs) / 3600.0
        for name, configs in campaigns.items()
    }
    hours = {
        name: [config.episodes / rates[case_of(config)] / 3600.0 for config in configs]
        for name, configs in campaigns.items()
    }
    return {
        'evaluations_per_cpu_second': rates, 'hours': hours, 'hours_of_assessment': assessments
    }


def table(results: dict) -> str:
    """Return the measurements as text."""
    lines = ['episodes per second of CPU time']
    lines += [f'  {case:20}{n:7.0f}' for case, n in results['evaluations_per_cpu_second'].items()]
    lines.append(f'{"":30}   runs  core-hours  assessment  longest run [min]'
                 + ''.join(f'{f"{cores} cores [h]":>16}' for cores in CORES))
    for name, hours in results['hours'].items():
        lines.append(
            f'{name:30}{len(hours):7d}{sum(hours):12.1f}'
            f'{results["hours_of_assessment"][name]:12.2f}{60.0 * max(hours):19.1f}'
            + ''.join(f'{makespan(hours, cores):16.2f}' for cores in CORES)
        )
    return '\n'.join(lines)


if __name__ == '__main__':
    run_part(__doc__, measure, table)
