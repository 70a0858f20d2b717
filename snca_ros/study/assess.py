"""The `assess` command: trained controllers on ground that they have not seen, and pushed."""

import argparse
import csv
import io
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path

import numpy as np

from sim_node.compiled import warm_up
from sim_node.errors import InvalidInput
from sim_node.simulation import Simulation
from sim_node.solver import ENGINES, check_engine
from sim_node.stamps import CONTROL_RATE
from sim_node.terrain import UNSEEN_TERRAINS, parse_terrain
from snca_ros.box import find_controller
from snca_ros.controller_file import TrainedController, load_controller
from snca_ros.evolution.locomotion import EPISODE, TRANSIENT, run_episode
from snca_ros.evolution.workers import Workers, add_worker_arguments, open_workers
from snca_ros.files import write_text

COLUMNS = ('controller', 'terrain', 'engine', 'start', 'v_x')
"""Of the CSV, a row per episode; start 0 is the exact one, others are pushed."""


@dataclass(frozen=True)
class Trial:
    """One episode of a trained controller.

    Attributes:
        trained: the controller, and the body that it was trained for.
        terrain: name of the ground.
        engine: one of `sim_node.solver.ENGINES`.
        start: 0, or the number of a pushed start, see `Simulation`.
        duration, transient: of the episode [s], and what its score ignores at the start [s].
    """

    trained: TrainedController
    terrain: str
    engine: str = 'pymunk'
    start: int = 0
    duration: float = EPISODE
    transient: float = TRANSIENT

    def simulation(self) -> Simulation:
        """Return the robot, put down."""
        trained = self.trained
        return Simulation(
            trained.morphology, self.terrain, material=trained.material, solver=trained.solver,
            engine=self.engine, push=self.start,
        )


def score(trial: Trial) -> float:
    """Return v_x [m/s] of a trial; -inf if it diverged."""
    simulation, controller = trial.simulation(), trial.trained.controller()
    name = f'trial-{trial.engine}'
    warm_up(name, lambda: run_episode(simulation, controller, 2.0 / CONTROL_RATE))
    return run_episode(simulation, controller, trial.duration).velocity(trial.transient)


def run_trials(workers: Workers, trials: Sequence[Trial]) -> np.ndarray:
    """Return v_x [m/s] of each trial, whatever the workers."""
    return np.array(list(workers.executor.map(score, trials)))


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `assess`."""
    parser.add_argument('controllers', nargs='+', metavar='CONTROLLER',
                        help='controller file (.npz), or the name of one in the box')
    parser.add_argument('--terrains', metavar='NAMES', default=','.join(UNSEEN_TERRAINS),
                        help='separated by commas (default: the 16 unseen ones)')
    parser.add_argument('--engine', default='pymunk', help=f'{", ".join(ENGINES)} (default pymunk)')
    parser.add_argument('--starts', type=int, default=0, metavar='N',
                        help='also walk from N pushed starts: mean and standard deviation')
    parser.add_argument('--csv', type=Path, metavar='FILE', help='write a row per episode here')
    parser.add_argument('--figure', type=Path, metavar='FILE',
                        help='picture to draw, .png, .svg or .pdf')
    add_worker_arguments(parser)


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Assess as the command line says; return the exit code."""
    from snca_ros.study.figures import check_figure, draw_scores, write_figure

    opened = open_workers(args, parser)
    if not 0 <= args.starts <= 10_000:
        raise InvalidInput('starts', args.starts, 'an integer from 0 to 10000')
    if args.figure:
        check_figure(args.figure)
    terrains = args.terrains.split(',')
    for name in terrains:
        parse_terrain(name)
    trained = [load_controller(find_controller(name)) for name in args.controllers]
    for controller in trained:
        check_engine(args.engine, controller.solver)
    trials = [
        Trial(controller, terrain, args.engine, start)
        for controller, terrain, start in product(trained, terrains, range(1 + args.starts))
    ]
    with opened as workers:
        v_x = run_trials(workers, trials)
    scores = v_x.reshape(len(trained), len(terrains), 1 + args.starts)
    print(f'v_x [m/s] of episodes of {EPISODE:g} s in the {args.engine} engine')
    for name, of_one in zip(args.controllers, scores, strict=True):
        print('\n'.join(['', *table(name, terrains, of_one)]), flush=True)
    if args.csv:
        _write_csv(args.csv, args.controllers, trials, v_x)
    if args.figure:
        write_figure(draw_scores(args.controllers, terrains, scores), args.figure)
    return 0


def table(name: str, terrains: Sequence[str], scores: np.ndarray) -> list[str]:
    """Return lines that tell the scores of one controller.

    Args:
        name: of the controller.
        terrains: their names.
        scores: (n_terrains, 1 + n_pushed) v_x [m/s]; of pushed starts mean and sample standard
            deviation are told. The last line has means over the terrains, start by start.
    """
    n_pushed = scores.shape[1] - 1
    head = f'{name:24}{"v_x":>9}'
    lines = [f'{head}{"mean":>9}{"std":>9}  of {n_pushed} pushed starts' if n_pushed else head]
    rows = [*zip(terrains, scores, strict=True), ('mean', scores.mean(axis=0))]
    for terrain, (exact, *pushed) in rows:
        numbers = [exact, *summary(pushed)] if pushed else [exact]
        lines.append(f'{terrain:24}' + ''.join(f'{number:9.3f}' for number in numbers))
    return lines


def summary(v_x: Sequence[float]) -> tuple[float, float]:
    """Return mean and sample standard deviation; -inf and NaN if an episode diverged."""
    with np.errstate(invalid='ignore'):
        return float(np.mean(v_x)), float(np.std(v_x, ddof=min(1, len(v_x) - 1)))


def _write_csv(
    path: Path, names: Sequence[str], trials: Sequence[Trial], v_x: np.ndarray
) -> None:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator='\n')
    writer.writerow(COLUMNS)
    each = len(trials) // len(names)
    for i, (trial, v) in enumerate(zip(trials, v_x.tolist(), strict=True)):
        writer.writerow([names[i // each], trial.terrain, trial.engine, trial.start, repr(v)])
    try:
        write_text(path, text.getvalue())
    except OSError as error:
        shown = f'{path}: {error.strerror}'
        raise InvalidInput('csv', shown, 'a file that can be written') from None
