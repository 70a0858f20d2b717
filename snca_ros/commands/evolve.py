"""The `evolve` command: trains the parameters of a robot's cells."""

import argparse
import math
import signal
import sys
from collections.abc import Callable
from concurrent.futures import BrokenExecutor
from pathlib import Path

import numpy as np

from sim_node.model.morphology import DEFAULT_SHAPE, SHAPES
from sim_node.model.sensors import DEFAULT_SENSORS
from sim_node.model.solver import Solver
from snca_ros.cell.architecture import ARCHITECTURES, DEFAULT_ARCHITECTURE, Architecture
from snca_ros.cell.models import DEFAULT_NEURON_MODEL, NEURON_MODELS
from snca_ros.command_line import INTERRUPTED
from snca_ros.commands.declared_options import (
    DeclaredOption,
    FormerOption,
    RepeatedOption,
    add_option,
)
from snca_ros.commands.json_output import add_json_option
from snca_ros.commands.worker_options import (
    add_worker_arguments,
    check_workers,
    open_workers,
)
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.fault_ranges import text_of
from snca_ros.evolution.run_progress import Progress
from snca_ros.evolution.tasks import TASKS, Task
from snca_ros.files import RUNS
from snca_ros.progress import StatusLine, TimeLeft, bars

EXAMPLES = """
  snca evolve --shape tripod --engine batched --episodes 3000 --run runs/tripod
  snca evolve --resume runs/tripod                  # continue after Ctrl-C or kill -9
  snca evolve --shape 1111-1001 --architecture nU-D --neuron-model mlp --seed 3
  snca evolve --terrain hilly-1-10-0 --strategy cma --workers 4
  snca evolve --shape biped,comb,tripod --terrain flat,hilly-1-10-0 --starts 5 --score mean
  snca evolve --faults none --faults loss=0..0.5,delay=0..3 --draw 8 --episodes 240000
"""

_OF_THE_CELL = ('n_c', 'hidden', 'as_printed', 'sensors')
_OF_THE_RUN = (
    'terrain', 'faults', 'starts', 'draw', 'score', 'episodes', 'seed', 'population', 'sigma',
    'duration', 'transient', 'engine', 'strategy', 'task',
)
_OF_THE_SOLVER = ('physics',)
_TEXT_WIDTH, _SHORTEST_BAR, _LONGEST_BAR = 71, 8, 40  # of the progress line [characters]


class ProgressLine:
    """Shows the progress of a run; on a terminal with a chart of the best score so far.

    Args:
        total: episodes of the run.
        done: episodes that are spent already.
        task: task of the run.
        ends: returns whether the run has no generation after so many episodes.
    """

    def __init__(
        self, total: int, done: int, task: Task, ends: Callable[[int], bool] | None = None
    ) -> None:
        self._unit, self._ends = task.unit, ends or (lambda done: done >= total)
        self._line = StatusLine()
        self._left = TimeLeft(total, done)

    def __call__(self, progress: Progress) -> None:
        """Show `progress`, if the last line is old enough."""
        done, total = progress.episodes, self._left.total
        _, _, best, median, worst, best_so_far = progress.history[-1]
        text = (
            f'{self._left.describe(done)}  best {best_so_far:.2f}  median {median:.2f} '
            f'({worst:.2f}…{best:.2f}) {self._unit}'
        ).rstrip()
        bar = self._bar(progress)
        head = f'{bar}  {100 * done // total} %' if bar else f'{done}/{total} episodes'
        self._line.show(f'{head}  {text}', last=self._ends(done))

    def _bar(self, progress: Progress) -> str:
        """Return a chart of the best score so far over the episodes; '' if it does not fit."""
        width = min(self._line.width - _TEXT_WIDTH, _LONGEST_BAR)
        if width < _SHORTEST_BAR:
            return ''
        so_far = np.array([row[-1] for row in progress.history])
        full = math.ceil(width * progress.episodes / self._left.total)
        return f'{bars(so_far, full)[0]:·<{width}}'


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `evolve`."""
    new = parser.add_argument_group('the run')
    new.add_argument('--shape', help=f'{", ".join(SHAPES)} with a size, or a grid 1111-1001; '
                     'several, separated by commas, for one controller of all '
                     f'(default {DEFAULT_SHAPE})')
    new.add_argument('--architecture',
                     help=f'{", ".join(ARCHITECTURES)} (default {DEFAULT_ARCHITECTURE})')
    new.add_argument('--neuron-model',
                     help=f'{", ".join(NEURON_MODELS)} (default {DEFAULT_NEURON_MODEL})')
    usual = {name: Architecture.named(f'U-{name}', DEFAULT_NEURON_MODEL).n_c
             for name in ('nD', 'D')}
    new.add_argument('--n-c', type=int, help='message channels per side (default '
                     f'{", ".join(f"{n} {name}" for name, n in usual.items())})')
    new.add_argument('--hidden', help='sizes of hidden layers, such as 20 or 16,8; 0 for none')
    new.add_argument('--as-printed', action='store_true', default=None,
                     help="use the paper's printed equations where the authors' code differs")
    new.add_argument('--sensors', help='sensors of each voxel, separated by commas '
                     f'(default {",".join(DEFAULT_SENSORS)})')
    for name in _OF_THE_RUN:
        action = RepeatedOption if name == 'faults' else DeclaredOption
        add_option(new, RunConfig, name, default=None, action=action)
    add_option(new, RunConfig, 'episodes', '--evaluations', FormerOption, dest='episodes',
               default=None, help=argparse.SUPPRESS)
    for name in _OF_THE_SOLVER:
        add_option(new, Solver, name, default=None)
    parser.add_argument('--run', type=Path, help=f'run folder (default {RUNS}/<settings>)')
    parser.add_argument('--resume', type=Path, metavar='RUN', help='continue the run in a folder')
    add_worker_arguments(parser)
    add_json_option(parser)


def _given(args: argparse.Namespace, names: tuple[str, ...]) -> dict:
    return {name: getattr(args, name) for name in names if getattr(args, name) is not None}


def _new_config(args: argparse.Namespace) -> RunConfig:
    named = ('shape', 'architecture', 'neuron_model')
    given = _given(args, (*named, *_OF_THE_CELL, *_OF_THE_RUN, *_OF_THE_SOLVER))
    if 'hidden' in given:
        given['hidden'] = _hidden_layers(given['hidden'])
    if 'sensors' in given:
        given['sensors'] = tuple(given['sensors'].split(','))
    if 'faults' in given:
        given['faults'] = ';'.join(text_of(text.strip()) for text in given['faults'].split(';'))
    return RunConfig.named(**given)


def _hidden_layers(text: str) -> tuple:
    sizes = tuple(int(s) if s.isascii() and s.isdigit() else s for s in text.split(','))
    return () if sizes == (0,) else sizes


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Start or resume a run; return the exit code."""
    opened = open_workers(args)
    if args.resume:
        options = ('shape', 'architecture', 'neuron_model', *_OF_THE_CELL, *_OF_THE_RUN,
                   *_OF_THE_SOLVER, 'run')
        extra = _given(args, options)
        if extra:
            option = next(iter(extra)).replace('_', '-')
            parser.error(f'--resume continues a run with its own settings; drop --{option}')
        folder = RunFolder.resume(args.resume)
    else:
        config = _new_config(args)
        config.new_strategy()  # raises InvalidInput if it is not installed, before mkdir
        check_workers(args)
        folder = RunFolder.create(args.run or RUNS / config.name, config)
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    print(f'{folder.path}: {_describe(folder.config)}', file=sys.stderr)
    task = TASKS.find(folder.config.task)
    try:
        done, config = folder.load().episodes, folder.config
        line = ProgressLine(config.episodes, done, task, lambda spent: not config.room(spent))
        with opened as workers:
            progress = evolve(folder, workers, line)
    except KeyboardInterrupt:
        print(f'\nstopped; continue with: snca evolve --resume {folder.path}', file=sys.stderr)
        return INTERRUPTED
    except BrokenExecutor:
        print(
            f'\na worker process ended unexpectedly (out of memory?); the run is intact up to '
            f'the last generation, continue with: snca evolve --resume {folder.path}',
            file=sys.stderr,
        )
        return 1
    finally:
        folder.close()
    args.write_json(_print_result(folder, progress, task))
    return 0


def _print_result(folder: RunFolder, progress: Progress, task: Task) -> dict[str, object]:
    """Print the scores of the best controller; return them for JSON."""
    _, chosen_by, found = progress.chosen(folder.config)
    best = folder.best(progress)
    quantity, over = folder.config.episode_set.described(task.quantity, best.n_episodes)
    scores = ', '.join(f'{task.in_unit(v, 4)} in {engine}' for engine, v in found.items())
    if progress.wall_time is not None:
        print(f'the best robot met the wall at the end of the ground at {progress.wall_time:.2f} s')
    print(
        f'{folder.path / "best.npz"}: {quantity} {scores},{over or " one episode"} each '
        f'(chosen by {chosen_by}), {progress.episodes} episodes'
    )
    return {
        'run': str(folder.path), 'controller': str(folder.path / 'best.npz'),
        'task': folder.config.task, 'quantity': task.quantity, 'unit': task.unit,
        'scores': found, 'chosen_by': chosen_by, 'episodes': progress.episodes,
        'score': folder.config.score, 'episodes_of_score': best.n_episodes,
    }


def _describe(config: RunConfig) -> str:
    cell = config.architecture
    usual = cell.sensors == DEFAULT_SENSORS
    sensors = '' if usual else f', sensors {", ".join(cell.sensors)}'
    episodes = config.episode_set
    return (
        f'{", ".join(episodes.shapes)} on {", ".join(episodes.terrains)}{episodes.summary}, '
        f'{cell.name} {cell.neuron_model}'
        f'{" as printed" if cell.as_printed else ""}, layers {cell.layer_sizes}, '
        f'{config.n_parameters} parameters{sensors}, seed {config.seed}, {config.engine} engine, '
        f'{config.solver.physics} physics, task {config.task}'
    )
