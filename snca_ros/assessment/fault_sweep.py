"""What `assess --faults` does: v_x against a fault that grows, mean and spread over starts."""

import argparse
import re
from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from itertools import product

import numpy as np
from matplotlib.figure import Figure

from sim_node.errors import InvalidInput
from snca_ros.assessment.trials import Trial, all_trials, run_trials, summary, write_csv
from snca_ros.controller_file import TrainedController
from snca_ros.evolution.episode import EPISODE
from snca_ros.evolution.workers import Workers
from snca_ros.faults import Faults, parse_faults
from snca_ros.recording.figures import write_figure

COLUMNS = ('controller', 'faults', 'x', 'terrain', 'engine', 'start', 'v_x')
"""Of the CSV, a row per episode; x is the value of the fault that grows."""

_NUMBER = r'\d+(?:\.\d+)?'
_RANGE = re.compile(rf'({_NUMBER})\.\.({_NUMBER})(?:\.\.({_NUMBER}))?')
_MAX_VALUES = 1000


@dataclass(frozen=True)
class Sweep:
    """A fault that grows.

    Attributes:
        text: of the faults, with one number given as a range.
        label: the same with x instead of the range.
        values: what x is.
        faults: for each value.
        texts: of the faults, for each value.
    """

    text: str
    label: str
    values: tuple[float, ...]
    faults: tuple[Faults, ...]
    texts: tuple[str, ...]


def parse_sweep(text: str) -> Sweep:
    """Return the sweep that `text` describes.

    Args:
        text: as `parse_faults` reads it, but one number is FROM..TO or FROM..TO..STEP, such as
            loss=0..0.9..0.1 or death=0..1@5. Without a step whole numbers grow by 1, others by a
            tenth of the range.

    Raises:
        InvalidInput: there is no such range or not one, or a value is off.
    """
    ranges = list(_RANGE.finditer(text))
    if len(ranges) != 1:
        raise InvalidInput('faults', text, 'one range FROM..TO[..STEP], as in loss=0..0.9..0.1')
    found = ranges[0]
    before, after = text[: found.start()], text[found.end() :]
    first, last = float(found[1]), float(found[2])
    whole = re.search(r'(delay|seed)=$', before)
    step = float(found[3]) if found[3] else 1.0 if whole else (last - first) / 10.0
    if not (first < last and step > 0.0 and (last - first) / step < _MAX_VALUES):
        raise InvalidInput('faults', found[0], f'up to {_MAX_VALUES} values, FROM below TO')
    n = 1 + int((last - first) / step + 1e-9)
    numbers = [f'{first + i * step:.9g}' for i in range(n)]
    texts = tuple(f'{before}{number}{after}' for number in numbers)
    faults = tuple(map(parse_faults, texts))
    return Sweep(text, f'{before}x{after}', tuple(map(float, numbers)), faults, texts)


def assess_faults(
    args: argparse.Namespace,
    trained: Sequence[TrainedController],
    terrains: Sequence[str],
    opened: AbstractContextManager[Workers],
) -> int:
    """Sweep as the command line says; return the exit code."""
    sweeps = [parse_sweep(text) for text in args.faults]
    n_starts = 1 + args.starts
    rows: list[tuple] = []
    scores = []
    with opened as workers:
        for sweep in sweeps:
            trials = sweep_trials(trained, sweep, terrains, args.engine, n_starts, args.duration)
            v_x = run_trials(workers, trials)
            shape = len(trained), len(sweep.values), n_starts, len(terrains)
            scores.append(v_x.reshape(shape).mean(axis=3))
            print('\n'.join(table(args.controllers, sweep, scores[-1])), end='\n\n', flush=True)
            points = product(args.controllers, sweep.values)
            at = [point for point in points for _ in range(n_starts * len(terrains))]
            rows += [
                (name, sweep.text, x, trial.terrain, trial.engine, trial.start, v)
                for (name, x), trial, v in zip(at, trials, v_x.tolist(), strict=True)
            ]
    if args.csv:
        write_csv(args.csv, COLUMNS, rows)
    if args.figure:
        write_figure(draw_sweeps(args.controllers, sweeps, scores), args.figure)
    return 0


def sweep_trials(
    trained: Sequence[TrainedController],
    sweep: Sweep,
    terrains: Sequence[str],
    engine: str,
    n_starts: int,
    duration: float = EPISODE,
) -> list[Trial]:
    """Return the episodes of a sweep, by controller, value, start and terrain."""
    return all_trials(trained, sweep.faults, terrains, engine, n_starts, duration)


def table(names: Sequence[str], sweep: Sweep, scores: np.ndarray) -> list[str]:
    """Return lines that tell mean and standard deviation over starts of each controller.

    Args:
        names: of the controllers.
        sweep: what was done.
        scores: (n_controllers, n_values, n_starts) v_x [m/s].
    """
    lines = [f'{sweep.label}: mean and standard deviation over {scores.shape[2]} starts']
    lines.append(f'{"x":>8}' + ''.join(f'  {name:>18}' for name in names))
    for value, of_all in zip(sweep.values, scores.swapaxes(0, 1), strict=True):
        pairs = (summary(of_one.tolist()) for of_one in of_all)
        lines.append(f'{value:8g}' + ''.join(f'  {m:9.3f}{s:9.3f}' for m, s in pairs))
    return lines


def draw_sweeps(
    names: Sequence[str], sweeps: Sequence[Sweep], scores: Sequence[np.ndarray]
) -> Figure:
    """Return a figure with a panel per sweep: mean v_x over starts, a standard deviation around.

    Args:
        names: of the controllers.
        sweeps: what was done.
        scores: (n_controllers, n_values, n_starts) v_x [m/s] of each sweep.
    """
    n_columns = min(3, len(sweeps))
    n_rows = -(-len(sweeps) // n_columns)
    figure = Figure(figsize=(0.8 + 2.6 * n_columns, 0.5 + 2.2 * n_rows), layout='constrained')
    panels = figure.subplots(n_rows, n_columns, sharey=True, squeeze=False).ravel()
    for axes in panels[len(sweeps) :]:
        axes.remove()
    for axes, sweep, of_sweep in zip(panels, sweeps, scores, strict=False):
        for i, of_one in enumerate(of_sweep):
            pairs = [summary(v_x.tolist()) for v_x in of_one]
            mean, std = np.array([p if np.isfinite(p).all() else (np.nan, np.nan) for p in pairs]).T
            color, label = f'C{i % 10}', names[i] if axes is panels[0] else None
            axes.plot(sweep.values, mean, '.-', color=color, label=label)
            axes.fill_between(sweep.values, mean - std, mean + std, color=color, alpha=0.25)
        axes.axhline(0.0, color='0.55', linewidth=0.5)
        axes.grid(axis='y', linewidth=0.5)
        axes.set_xlabel(sweep.label, fontsize=8)
        axes.tick_params(labelsize=8)
    for axes in panels[::n_columns]:
        axes.set_ylabel('v_x [m/s]', fontsize=8)
    figure.legend(loc='outside upper left', fontsize=8)
    return figure
