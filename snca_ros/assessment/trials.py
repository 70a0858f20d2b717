"""The `assess` command: trained controllers on ground that they have not seen, and pushed."""

import argparse
import csv
import io
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.errors import InvalidInput
from sim_node.model.solver import ENGINES, check_engine
from sim_node.model.terrain import UNSEEN_TERRAINS, parse_terrain, unseen_terrains
from sim_node.numerics.jit import warm_up
from sim_node.simulation import Simulation
from snca_ros.bundled import find_controller
from snca_ros.controller_file import TrainedController, load_controller
from snca_ros.evolution.episode import EPISODE, LONGEST, TRANSIENT, run_episode
from snca_ros.evolution.workers import Workers, add_worker_arguments, open_workers
from snca_ros.faults import NO_FAULTS, Faults
from snca_ros.files import check_writable, write_text

COLUMNS = ('controller', 'terrain', 'engine', 'start', 'v_x')
"""Of the CSV, a row per episode; start 0 is the exact one, others are pushed. Rows of a kind of
terrain have the mean over its seeds, and those of `MEAN` that over the terrains or, of several
seeds, over the kinds; start by start."""

MEAN = 'mean'

FAULTY_STARTS = 9
"""Pushed starts beside the exact one for each value of a fault, if nobody says how many."""


EXAMPLES = """
  snca assess runs/tripod/best.npz                  # v_x on 16 terrains that it has not seen
  snca assess runs/tripod/best.npz --terrain-seeds 10   # 10 of each irregular one of them
  snca assess biped-U-nD-snn-h --terrains flat,uphill-10 --starts 20 --engine batched
  snca assess biped-U-nD-snn-h --faults loss=0..0.9..0.1 --figure loss.png --csv loss.csv
"""


@dataclass(frozen=True)
class Trial:
    """One episode of a trained controller.

    Attributes:
        trained: the controller, and the body that it was trained for.
        terrain: name of the ground.
        engine: one of `sim_node.model.solver.ENGINES`.
        start: 0, or the number of a pushed start, see `Simulation`.
        faults: what goes wrong.
        duration, transient: of the episode [s], and what its score ignores at the start [s].
    """

    trained: TrainedController
    terrain: str
    engine: str = 'pymunk'
    start: int = 0
    faults: Faults = NO_FAULTS
    duration: float = EPISODE
    transient: float = TRANSIENT

    def simulation(self) -> Simulation:
        """Return the robot, put down."""
        return self.trained.simulation(self.terrain, self.engine, self.start, self.faults)


def score(trial: Trial) -> float:
    """Return v_x [m/s] of a trial; -inf if it diverged."""
    simulation, controller = trial.simulation(), trial.trained.controller(trial.faults)
    name = f'trial-{trial.engine}{"-faulty" if trial.faults.affect_cells else ""}'
    warm_up(name, lambda: run_episode(simulation, controller, 2.0 / CONTROL_RATE))
    return run_episode(simulation, controller, trial.duration).velocity(trial.transient)


def run_trials(workers: Workers, trials: Sequence[Trial]) -> np.ndarray:
    """Return v_x [m/s] of each trial, whatever the workers."""
    return np.array(list(workers.executor.map(score, trials)))


def all_trials(
    trained: Sequence[TrainedController],
    faults: Sequence[Faults],
    terrains: Sequence[str],
    engine: str,
    n_starts: int,
    duration: float = EPISODE,
) -> list[Trial]:
    """Return the episodes of all combinations, by controller, faults, start and terrain.

    Start s draws its faults from their seed plus s.
    """
    return [
        Trial(one, terrain, engine, start, replace(wrong, seed=wrong.seed + start), duration)
        for one, wrong, start, terrain in product(trained, faults, range(n_starts), terrains)
    ]


def check_trials(starts: int, duration: float) -> None:
    """Raise InvalidInput if pushed starts or the seconds of an episode are out of range."""
    if isinstance(starts, bool) or not isinstance(starts, int) or not 0 <= starts <= 10_000:
        raise InvalidInput('starts', starts, 'an integer from 0 to 10000')
    if not isinstance(duration, (int, float)) or not TRANSIENT < duration <= LONGEST:
        expected = f'a time above {TRANSIENT:g} s, up to {LONGEST:g} s'
        raise InvalidInput('duration', duration, expected)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `assess`."""
    parser.add_argument('controllers', nargs='+', metavar='CONTROLLER',
                        help='controller file (.npz), or the name of one in the box')
    parser.add_argument('--terrains', metavar='NAMES',
                        help='separated by commas (default: the 16 unseen ones; '
                        'with --faults flat)')
    parser.add_argument('--terrain-seeds', type=int, metavar='N',
                        help='N seeds of each irregular unseen terrain: mean of each kind, and of '
                        'all kinds (default 1)')
    parser.add_argument('--engine', default='pymunk', help=f'{", ".join(ENGINES)} (default pymunk)')
    parser.add_argument('--starts', type=int, metavar='N',
                        help='also walk from N pushed starts: mean and standard deviation '
                        f'(default 0; with --faults {FAULTY_STARTS})')
    parser.add_argument('--duration', type=float, default=EPISODE,
                        help=f'seconds of an episode (default {EPISODE:g})')
    parser.add_argument('--faults', action='append', default=[], metavar='SPEC',
                        help='let a fault grow instead, FROM..TO[..STEP] in place of its number: '
                        'loss=0..0.9..0.1, delay=0..10, death=0..1@5; again for another panel')
    parser.add_argument('--csv', type=Path, metavar='FILE',
                        help='write a row per episode here, and without --faults the means '
                        'over the terrains')
    parser.add_argument('--figure', type=Path, metavar='FILE',
                        help='picture to draw, .png, .svg or .pdf')
    add_worker_arguments(parser)


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Assess as the command line says; return the exit code."""
    from snca_ros.assessment.fault_sweep import assess_faults
    from snca_ros.recording.figures import check_figure, draw_scores, write_figure

    opened = open_workers(args, parser)
    if args.starts is None:
        args.starts = FAULTY_STARTS if args.faults else 0
    check_trials(args.starts, args.duration)
    if args.figure:
        check_figure(args.figure)
    if args.csv:
        check_writable('csv', args.csv)
    kinds = _kinds(args)
    terrains = [name for names in kinds.values() for name in names]
    for name in terrains:
        parse_terrain(name)
    trained = [load_controller(find_controller(name)) for name in args.controllers]
    for controller in trained:
        check_engine(args.engine, controller.solver)
    if args.faults:
        return assess_faults(args, trained, terrains, opened)
    trials = [
        Trial(controller, terrain, args.engine, start, duration=args.duration)
        for controller, terrain, start in product(trained, terrains, range(1 + args.starts))
    ]
    with opened as workers:
        v_x = run_trials(workers, trials)
    episodes = v_x.reshape(len(trained), len(terrains), 1 + args.starts)
    scores = np.stack([means_of_kinds(kinds, of_one) for of_one in episodes])
    names = [*kinds, MEAN]
    print(f'v_x [m/s] of episodes of {args.duration:g} s in the {args.engine} engine')
    for name, of_one in zip(args.controllers, scores, strict=True):
        print('\n'.join(['', *table(name, names, of_one)]), flush=True)
    if args.csv:
        means = [i for i, name in enumerate(names) if name not in terrains]
        told = [*terrains, *(names[i] for i in means)]
        each = product(args.controllers, told, [args.engine], range(1 + args.starts))
        v_x = np.concatenate([episodes, scores[:, means]], axis=1).ravel()
        write_csv(args.csv, COLUMNS, [(*e, v) for e, v in zip(each, v_x.tolist(), strict=True)])
    if args.figure:
        write_figure(draw_scores(args.controllers, names, scores), args.figure)
    return 0


def _kinds(args: argparse.Namespace) -> dict[str, tuple[str, ...]]:
    """Return the names of the terrains that the command line asks for, kind by kind.

    Without several seeds each terrain is a kind of its own.
    """
    if args.terrain_seeds is not None:
        for option, given in (('terrains', args.terrains is not None), ('faults', args.faults)):
            if given:
                expected = f'none with --{option}: it is of the unseen terrains'
                raise InvalidInput('terrain_seeds', args.terrain_seeds, expected)
        found = unseen_terrains(args.terrain_seeds)
        if args.terrain_seeds > 1:
            return found
    names = ['flat'] if args.faults else [*UNSEEN_TERRAINS]
    if args.terrains is not None:
        names = args.terrains.split(',')
    return {name: (name,) for name in names}


def means_of_kinds(kinds: dict[str, tuple[str, ...]], v_x: np.ndarray) -> np.ndarray:
    """Return the means over the terrains of each kind, and that over the kinds, (n_kinds + 1, n).

    Args:
        kinds: to the names of their terrains.
        v_x: (n_terrains, n) [m/s] of each terrain, kind by kind, and start.
    """
    ends = np.cumsum([len(names) for names in kinds.values()])[:-1]
    means = np.stack([of_kind.mean(axis=0) for of_kind in np.split(v_x, ends)])
    return np.concatenate([means, means.mean(axis=0, keepdims=True)])


def table(name: str, terrains: Sequence[str], scores: np.ndarray) -> list[str]:
    """Return lines that tell the scores of one controller.

    Args:
        name: of the controller.
        terrains: their names.
        scores: (n_terrains, 1 + n_pushed) v_x [m/s]; of pushed starts mean and sample standard
            deviation are told.
    """
    n_pushed = scores.shape[1] - 1
    head = f'{"":24}{"v_x":>9}'
    head = f'{head}{"mean":>9}{"std":>9}  of {n_pushed} pushed starts' if n_pushed else head
    lines = [name, head]
    for terrain, (exact, *pushed) in zip(terrains, scores, strict=True):
        numbers = [exact, *summary(pushed)] if pushed else [exact]
        lines.append(f'{terrain:24}' + ''.join(f'{number:9.3f}' for number in numbers))
    return lines


def summary(v_x: Sequence[float]) -> tuple[float, float]:
    """Return mean and sample standard deviation; -inf and NaN if an episode diverged."""
    with np.errstate(invalid='ignore'):
        return float(np.mean(v_x)), float(np.std(v_x, ddof=min(1, len(v_x) - 1)))


def write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence]) -> None:
    """Write a table, atomically; InvalidInput if it cannot be written."""
    text = io.StringIO()
    csv.writer(text, lineterminator='\n').writerows([columns, *rows])
    try:
        write_text(path, text.getvalue())
    except OSError as error:
        shown = f'{path}: {error.strerror}'
        raise InvalidInput('csv', shown, 'a file that can be written') from None
