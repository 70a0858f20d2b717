"""The `assess` command: scores of trained controllers on unseen terrains and with faults."""

import argparse
from collections.abc import Sequence
from contextlib import AbstractContextManager
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from sim_node.engine import check_engine
from sim_node.errors import InvalidInput
from sim_node.model.constants import help_of
from sim_node.model.morphology import parse_morphology
from sim_node.model.terrain import UNSEEN_TERRAINS, parse_terrain, unseen_terrains
from snca_ros.assessment import fault_sweep, transfer
from snca_ros.assessment.fault_sweep import parse_sweep, sweep_trials
from snca_ros.assessment.running import run_trials
from snca_ros.assessment.transfer import Transfer, in_bodies, matrix, transfer_trials
from snca_ros.assessment.trials import (
    COLUMNS,
    FAULTY_STARTS,
    MEAN,
    AssessmentOptions,
    Trial,
    common_task,
    means_of_kinds,
    table,
    wall_cells,
    wall_lines,
    write_csv,
)
from snca_ros.bundled import find_controller
from snca_ros.commands.body_options import WITHOUT_HELP
from snca_ros.commands.declared_options import add_option
from snca_ros.commands.json_output import add_json_option
from snca_ros.commands.worker_options import add_worker_arguments, open_workers
from snca_ros.controller_file import load_controller
from snca_ros.evolution.tasks import Task
from snca_ros.evolution.workers import Workers
from snca_ros.files import check_writable
from snca_ros.trained_controller import TrainedController

EXAMPLES = """
  snca assess runs/tripod/best.npz                  # v_x on 16 terrains that it has not seen
  snca assess runs/tripod/best.npz --terrain-seeds 10   # 10 of each irregular one of them
  snca assess biped-U-nD-snn-h --terrains flat,uphill-10 --starts 20 --engine batched
  snca assess biped-U-nD-snn-h --faults loss=0..0.9..0.1 --figure loss.png --csv loss.csv
  snca assess biped-U-nD-snn-h --faults delay=0..3 --starts 20 --engine batched  # side by side
  snca assess biped-U-nD-snn-h --arithmetic int16       # as its firmware would walk
  snca assess biped-U-nD-snn-h comb-U-nD-snn-h --shape biped,comb,tripod --figure transfer.png
  snca assess biped-U-nD-snn-h --without voxel_1_1      # on the 16 terrains, without a voxel
"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `assess`."""
    parser.add_argument('controllers', nargs='+', metavar='CONTROLLER',
                        help='controller file (.npz), run folder, or the name of a bundled one')
    parser.add_argument('--shape', default='', metavar='SHAPES',
                        help='bodies, separated by commas, in which to score each controller: a '
                        'table with a row per controller; only uniform ones fit other bodies')
    parser.add_argument('--without', default='', metavar='VOXELS', help=WITHOUT_HELP)
    parser.add_argument('--terrains', metavar='NAMES',
                        help='terrains, separated by commas (default: the '
                        f'{len(UNSEEN_TERRAINS)} unseen ones; with --faults or --shape that of the '
                        'task)')
    add_option(parser, AssessmentOptions, 'terrain_seeds', metavar='N', default=None)
    add_option(parser, AssessmentOptions, 'engine')
    add_option(parser, AssessmentOptions, 'arithmetic')
    add_option(parser, AssessmentOptions, 'starts', metavar='N', default=None,
               help=f'{help_of(AssessmentOptions, "starts")[:-1]}; with --faults or --shape '
               f'{FAULTY_STARTS}): adds mean and standard deviation')
    add_option(parser, AssessmentOptions, 'duration')
    parser.add_argument('--faults', action='append', default=[], metavar='SPEC',
                        help='sweep a fault, whose number is a range FROM..TO[..STEP]: '
                        'loss=0..0.9..0.1, delay=0..10, death=0..1@5; repeat for more panels')
    parser.add_argument('--csv', type=Path, metavar='FILE',
                        help='write a row per episode to this file, and without --faults the means '
                        'over the terrains')
    parser.add_argument('--figure', type=Path, metavar='FILE',
                        help='draw a figure, .png, .svg or .pdf')
    add_worker_arguments(parser)
    add_json_option(parser)


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Assess controllers and print, write and draw their scores; return the exit code."""
    from snca_ros.figures import check_figure  # matplotlib loads slowly

    opened = open_workers(args)
    if args.starts is None:
        several = args.faults or args.shape
        args.starts = FAULTY_STARTS if several else AssessmentOptions.starts
    AssessmentOptions(args.starts, args.duration, args.engine, args.arithmetic)
    if args.figure:
        check_figure(args.figure)
    if args.csv:
        check_writable('csv', args.csv)
    trained = [
        load_controller(find_controller(name)).in_arithmetic(args.arithmetic)
        for name in args.controllers
    ]
    for controller in trained:
        check_engine(args.engine, controller.solver)
    task = common_task(trained)
    kinds = _kinds(args, task)
    terrains = [name for names in kinds.values() for name in names]
    for name in terrains:
        parse_terrain(name)
    if args.shape:
        bodies = [parse_morphology(one).without(args.without) for one in args.shape.split(',')]
        placed = in_bodies(args.controllers, trained, bodies)
        if not args.faults:
            return _assess_transfer(args, placed, terrains, opened, task)
        args.controllers, trained = placed.named_robots()
    elif args.without:
        trained = [one.without(args.without) for one in trained]
        args.controllers = [f'{name} without {args.without}' for name in args.controllers]
    if args.faults:
        return _assess_faults(args, trained, terrains, opened, task)
    trials = [
        Trial(controller, terrain, args.engine, start, duration=args.duration)
        for controller, terrain, start in product(trained, terrains, range(1 + args.starts))
    ]
    with opened as workers:
        found, times = run_trials(workers, trials)
    episodes = found.reshape(len(trained), len(terrains), 1 + args.starts)
    scores = np.stack([means_of_kinds(kinds, of_one) for of_one in episodes])
    names = [*kinds, MEAN]
    print(f'{task.label} of episodes of {args.duration:g} s in the {args.engine} engine')
    for name, of_one in zip(args.controllers, scores, strict=True):
        print('\n'.join(['', *table(name, names, of_one, task.quantity)]), flush=True)
    for line in wall_lines(times, task):
        print(line)
    means = [i for i, name in enumerate(names) if name not in terrains]
    grounds = [*terrains, *(names[i] for i in means)]
    each = product(args.controllers, grounds, [args.engine], range(1 + args.starts))
    values = np.concatenate([episodes, scores[:, means]], axis=1).ravel().tolist()
    met = np.full((len(trained), len(grounds), 1 + args.starts, 2), np.nan)
    met[:, : len(terrains)] = times.reshape(*episodes.shape, 2)
    rows = [(*e, *walls, v) for e, walls, v in zip(each, wall_cells(met), values, strict=True)]
    _write(args, (*COLUMNS, task.quantity), rows, task)
    if args.figure:
        from snca_ros.assessment.figures import draw_scores
        from snca_ros.figures import write_figure

        write_figure(draw_scores(args.controllers, names, scores, task), args.figure)
    return 0


def _write(
    args: argparse.Namespace, columns: Sequence[str], rows: Sequence[tuple], task: Task, **more: Any
) -> None:
    """Write scores to the files of --csv and --json, and `more` to the latter."""
    if args.csv:
        write_csv(args.csv, columns, rows)
    args.write_json({
        'quantity': task.quantity, 'unit': task.unit, 'duration': args.duration,
        'scores': [dict(zip(columns, row, strict=True)) for row in rows], **more,
    })


def _kinds(args: argparse.Namespace, task: Task) -> dict[str, tuple[str, ...]]:
    """Return the names of the terrains of the command line, by kind.

    Without several seeds, each terrain is a kind of its own.
    """
    if args.terrain_seeds is not None:
        for option in ('terrains', 'faults', 'shape'):
            if getattr(args, option):
                expected = f'no --terrain-seeds with --{option}: it sets seeds of unseen terrains'
                raise InvalidInput('terrain_seeds', args.terrain_seeds, expected)
        found = unseen_terrains(args.terrain_seeds)
        if args.terrain_seeds > 1:
            return found
    names = [task.terrain] if args.faults or args.shape else [*UNSEEN_TERRAINS]
    if args.terrains is not None:
        names = args.terrains.split(',')
    return {name: (name,) for name in names}


def _assess_transfer(
    args: argparse.Namespace,
    placed: Transfer,
    terrains: Sequence[str],
    opened: AbstractContextManager[Workers],
    task: Task,
) -> int:
    """Score controllers in bodies and print, write and draw the matrix; return the exit code."""
    pairs, n_starts = placed.pairs(), 1 + args.starts
    trials = transfer_trials(placed, terrains, args.engine, n_starts, args.duration)
    with opened as workers:
        found, times = run_trials(workers, trials)
    means, deviations = matrix(placed, found.reshape(len(pairs), n_starts, len(terrains)))
    starts = f'mean of {args.starts} pushed starts' if args.starts else 'exact start'
    print(
        f'{task.label} of episodes of {args.duration:g} s on {", ".join(terrains)} in the '
        f'{args.engine} engine, {starts}\n'
    )
    print('\n'.join([*transfer.table(placed, means), *wall_lines(times, task)]), flush=True)
    each = [pair for pair in pairs for _ in range(n_starts * len(terrains))]
    rows = [
        (placed.names[i], placed.labels[j], bool(placed.home[i, j]), trial.terrain,
         trial.engine, trial.start, *walls, v)
        for (i, j, _), trial, walls, v in zip(
            each, trials, wall_cells(times), found.tolist(), strict=True
        )
    ]
    _write(args, (*transfer.COLUMNS, task.quantity), rows, task, matrix=[
        {'controller': placed.names[i], 'body': placed.labels[j],
         'home': bool(placed.home[i, j]), 'mean': means[i, j], 'std': deviations[i, j]}
        for i, j, _ in pairs
    ])
    if args.figure:
        from snca_ros.assessment.figures import draw_transfer
        from snca_ros.figures import write_figure

        write_figure(draw_transfer(placed, means, task), args.figure)
    return 0


def _assess_faults(
    args: argparse.Namespace,
    trained: Sequence[TrainedController],
    terrains: Sequence[str],
    opened: AbstractContextManager[Workers],
    task: Task,
) -> int:
    """Sweep faults and print, write and draw the scores; return the exit code."""
    sweeps = [parse_sweep(text) for text in args.faults]
    n_starts = 1 + args.starts
    rows: list[tuple] = []
    scores = []
    with opened as workers:
        for sweep in sweeps:
            trials = sweep_trials(trained, sweep, terrains, args.engine, n_starts, args.duration)
            found, times = run_trials(workers, trials)
            shape = len(trained), len(sweep.values), n_starts, len(terrains)
            scores.append(found.reshape(shape).mean(axis=3))
            lines = fault_sweep.table(args.controllers, sweep, scores[-1])
            print('\n'.join([*lines, *wall_lines(times, task)]), end='\n\n', flush=True)
            points = product(args.controllers, sweep.values)
            at = [point for point in points for _ in range(n_starts * len(terrains))]
            rows += [
                (name, sweep.text, x, trial.terrain, trial.engine, trial.start, *walls, v)
                for (name, x), trial, walls, v in zip(
                    at, trials, wall_cells(times), found.tolist(), strict=True
                )
            ]
    _write(args, (*fault_sweep.COLUMNS, task.quantity), rows, task)
    if args.figure:
        from snca_ros.assessment.figures import draw_sweeps
        from snca_ros.figures import write_figure

        write_figure(draw_sweeps(args.controllers, sweeps, scores, task), args.figure)
    return 0
