"""Fault sweeps: scores of controllers as a function of the value of a fault."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_node.errors import InvalidInput
from snca_ros.assessment.trials import WALLS, Trial, all_trials, summary
from snca_ros.evolution.episode import EPISODE
from snca_ros.faults import Faults, parse_faults
from snca_ros.trained_controller import TrainedController

COLUMNS = ('controller', 'faults', 'x', 'terrain', 'engine', 'start', *WALLS)
"""Columns of the CSV file, one row per episode; the last column is the score, named after the
task's quantity. x is the value of the swept fault."""

_NUMBER = r'\d+(?:\.\d+)?'
_RANGE = re.compile(rf'({_NUMBER})\.\.({_NUMBER})(?:\.\.({_NUMBER}))?')
_MAX_VALUES = 1000


@dataclass(frozen=True)
class Sweep:
    """A sweep over the values of one fault.

    Attributes:
        text: text of the faults, in which one number is a range.
        label: the text with x in place of the range.
        values: the values of x.
        faults: the faults for each value.
        texts: the text of the faults for each value.
    """

    text: str
    label: str
    values: tuple[float, ...]
    faults: tuple[Faults, ...]
    texts: tuple[str, ...]


def parse_sweep(text: str) -> Sweep:
    """Return the sweep that `text` describes.

    Args:
        text: as for `parse_faults`, but one number is FROM..TO or FROM..TO..STEP, such as
            loss=0..0.9..0.1 or death=0..1@5. The default step is 1 for integers, else a tenth of
            the range.

    Raises:
        InvalidInput: there is not exactly one range, or a value is invalid.
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


def sweep_trials(
    trained: Sequence[TrainedController],
    sweep: Sweep,
    terrains: Sequence[str],
    engine: str,
    n_starts: int,
    duration: float = EPISODE,
) -> list[Trial]:
    """Return the episodes of a sweep, ordered by controller, value, start and terrain."""
    return all_trials(trained, sweep.faults, terrains, engine, n_starts, duration)


def table(names: Sequence[str], sweep: Sweep, scores: np.ndarray) -> list[str]:
    """Return a table, as lines of text, of mean and standard deviation over starts.

    Args:
        names: names of the controllers.
        sweep: the sweep.
        scores: (n_controllers, n_values, n_starts).
    """
    lines = [f'{sweep.label}: mean and standard deviation over {scores.shape[2]} starts']
    lines.append(f'{"x":>8}' + ''.join(f'  {name:>18}' for name in names))
    for value, of_all in zip(sweep.values, scores.swapaxes(0, 1), strict=True):
        pairs = (summary(of_one.tolist()) for of_one in of_all)
        lines.append(f'{value:8g}' + ''.join(f'  {m:9.3f}{s:9.3f}' for m, s in pairs))
    return lines
