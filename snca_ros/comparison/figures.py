"""Figures that compare types of controllers, one per shape, like those of the paper."""

from collections.abc import Sequence
from dataclasses import replace

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch, Rectangle

from snca_ros.campaign.results import read_curve
from snca_ros.cell.architecture import ARCHITECTURES
from snca_ros.cell.models import NEURON_MODELS
from snca_ros.comparison.pairwise import Contrast
from snca_ros.comparison.rank_test import quartiles
from snca_ros.comparison.runs import (
    END,
    MEASURES,
    OTHER_ENGINE,
    PUSHED,
    UNSEEN,
    Cases,
    ControllerType,
    Run,
    column_of,
    controller_types,
    known_measures,
)
from snca_ros.comparison.style import INK, STYLE, new_panel, svg_text
from snca_ros.comparison.tables import FAST_PEAK, VIBRATING_SHARE, format_p
from snca_ros.figures import own_style
from snca_ros.recording.gait import VIBRATION

_BOXES = {END: (-0.2, 0.9), UNSEEN: (0.2, 0.4)}  # measure: offset and opacity
_LIGHT_TEXT, _DARK_TEXT = '#fafafa', '#101010'  # on coloured cells, in both colour schemes
_GREY = '#777777'


def draw_all(cases: Cases, shown: Sequence[Contrast]) -> list[tuple[str, str, str]]:
    """Return kind, shape and SVG text of every figure.

    Args:
        cases: the runs.
        shown: the contrasts whose p-values are drawn above and below the boxes.

    Raises:
        InvalidInput: the history of a run cannot be used.
    """
    colors = {c: f'C{i % 10}' for i, c in enumerate(controller_types(cases))}
    everything = [run for of in cases.values() for runs in of.values() for run in runs]
    measures = known_measures(cases)
    speeds = np.concatenate([column_of(everything, measure) for measure in measures])
    vibrations = all(run.knows_vibration for run in everything)
    found = speeds[np.isfinite(speeds)]
    lowest, highest = found.min(initial=0.0), found.max(initial=0.0) or 1.0
    figures: list[tuple[str, str, Figure]] = []
    with own_style(STYLE):
        for shape, of_shape in cases.items():
            of_it = [contrast for contrast in shown if contrast.shape == shape]
            figures += [
                ('boxes', shape, _draw_boxes(shape, of_shape, of_it, colors, (lowest, highest))),
                ('medians', shape, _draw_medians(shape, of_shape, measures, highest)),
                ('curves', shape, _draw_curves(shape, of_shape, colors)),
                _draw_vibration(shape, of_shape, colors) if vibrations
                else _draw_frequencies(shape, of_shape, colors),
                ('variance', shape, _draw_variance(shape, of_shape, colors)),
            ]
        return [(kind, shape, svg_text(figure)) for kind, shape, figure in figures]


def _draw_boxes(
    shape: str, of_shape: dict[ControllerType, list[Run]], shown: Sequence[Contrast],
    colors: dict[ControllerType, str], extent: tuple[float, float],
) -> Figure:
    """Draw the speeds of each type as a pair of boxes, on the same scale for every shape.

    Args:
        shape: name of the shape.
        of_shape: its runs by type of controller.
        shown: contrasts on this shape, drawn as p-values above and below the boxes.
        colors: colours of the types.
        extent: smallest and largest speed [m/s] of all shapes.
    """
    levels = sum(contrast.measure == END for contrast in shown)
    figure, axes = new_panel(shape, 3.4 + 0.3 * levels, max(4.4, 0.75 * len(of_shape)))
    for place, (controller, runs) in enumerate(of_shape.items()):
        for measure, (aside, alpha) in _BOXES.items():
            _draw_box(axes, column_of(runs, measure), place + aside, colors[controller], alpha)
    low, high = extent
    step = 0.11 * (high - low)
    low, high = low - 0.5 * step, high + 0.5 * step
    for measure, (aside, _) in _BOXES.items():
        of_measure = [contrast for contrast in shown if contrast.measure == measure]
        away = step if aside < 0.0 else -step
        edge = high if away > 0.0 else low
        for level, contrast in enumerate(of_measure):
            _draw_bracket(axes, contrast, list(of_shape), aside, edge + level * away, away)
    axes.set_ylim(low - levels * step, high + levels * step)
    axes.set_xticks(range(len(of_shape)), _ticks(of_shape))
    axes.set_ylabel('v_x [m/s]')
    axes.grid(axis='y', linewidth=0.4, alpha=0.5)
    named = [
        Patch(facecolor=_GREY, alpha=alpha, edgecolor=INK, label=MEASURES[measure])
        for measure, (_, alpha) in _BOXES.items()
    ]
    axes.legend(
        handles=named, loc='lower right', bbox_to_anchor=(1.0, 1.0), ncol=len(named), fontsize=7.5
    )
    return figure


def _ticks(of_shape: dict[ControllerType, list[Run]]) -> list[str]:
    return [
        str(controller).replace(' ', '\n', 1).replace(', ', ',\n') + f'\nn = {len(runs)}'
        for controller, runs in of_shape.items()
    ]


def _draw_box(axes: Axes, values: np.ndarray, place: float, color: str, alpha: float) -> None:
    """Draw a box of quartiles with Tukey's whiskers, and every value as a dot."""
    values = values[np.isfinite(values)]
    axes.boxplot(
        [values], positions=[place], widths=0.34, patch_artist=True, showfliers=False,
        boxprops={'facecolor': color, 'alpha': alpha, 'edgecolor': INK},
        medianprops={'color': INK, 'linewidth': 1.6},
        whiskerprops={'color': INK}, capprops={'color': INK},
    )
    axes.plot(np.full(len(values), place), values, '.', color=INK, markersize=2.5, alpha=0.6)


def _draw_bracket(
    axes: Axes, contrast: Contrast, types: list[ControllerType], aside: float, at: float,
    away: float,
) -> None:
    ends = [types.index(c) + aside for c in (contrast.first, contrast.second)]
    foot = at - 0.2 * away
    axes.plot([ends[0], *ends, ends[1]], [foot, at, at, foot], color=INK, linewidth=0.8)
    text = f'{format_p(contrast.result.p)} ({format_p(contrast.p_holm)})'
    axes.text(
        float(np.mean(ends)), at + 0.08 * away, text, ha='center', fontsize=7.5,
        va='bottom' if away > 0.0 else 'top',
    )


def _draw_medians(
    shape: str, of_shape: dict[ControllerType, list[Run]], measures: dict[str, str],
    highest: float,
) -> Figure:
    """Draw the table of medians, architectures × neuron models, with a panel per measure.

    Types with other settings have rows of their own.
    """
    usual = [a for a in ARCHITECTURES if a != 'nU-nD' or any(c.architecture == a for c in of_shape)]
    variants = sorted({(c.as_printed, c.settings) for c in of_shape})
    rows = [ControllerType(a, 'mlp', *variant) for variant in variants for a in usual]
    n, longest = len(measures), max(len(str(row)) for row in rows)
    width = n * (7.0 / 3.0 + 0.07 * max(0, longest - 20))
    figure = Figure(figsize=(width, 0.8 + 0.5 * len(rows)), layout='constrained')
    for axes, (measure, title) in zip(figure.subplots(1, n), measures.items(), strict=True):
        axes.set_title(f'{shape}: {title}', fontsize=9)
        for y, row in enumerate(rows):
            for x, model in enumerate(NEURON_MODELS):
                runs = of_shape.get(replace(row, neuron_model=model), [])
                _draw_cell(axes, x, y, column_of(runs, measure), highest)
        axes.set(xlim=(-0.5, 2.5), ylim=(len(rows) - 0.5, -0.5))
        axes.set_xticks(range(len(NEURON_MODELS)), [model.upper() for model in NEURON_MODELS])
        axes.set_yticks(range(len(rows)), [str(row).replace(' MLP', '') for row in rows])
        axes.tick_params(length=0)
        axes.spines[:].set_visible(False)
    return figure


def _draw_cell(axes: Axes, x: int, y: int, values: np.ndarray, highest: float) -> None:
    """Draw the median of values in a cell of the table, or a dash if there are none."""
    if not len(values):
        axes.text(x, y, '–', ha='center', va='center')
        return
    median = float(quartiles(values)[1])
    share = min(max(median / highest, 0.0), 1.0)
    ink = _LIGHT_TEXT if share > 0.6 else _DARK_TEXT
    color = mpl.colormaps['GnBu'](share)
    axes.add_patch(Rectangle((x - 0.48, y - 0.46), 0.96, 0.92, color=color))
    axes.text(x, y, f'{median:.1f}', ha='center', va='bottom', color=ink, fontsize=11)
    axes.text(x, y + 0.08, f'n = {len(values)}', ha='center', va='top', color=ink, fontsize=7)


def _draw_curves(
    shape: str, of_shape: dict[ControllerType, list[Run]], colors: dict[ControllerType, str]
) -> Figure:
    """Draw the best v_x so far: median and quartiles of each type, up to its shortest run."""
    figure, axes = new_panel(shape)
    for controller, runs in of_shape.items():
        episodes, found = median_curve([read_curve(run.history) for run in runs])
        low, median, high = np.where(np.isfinite(found), found, np.nan)
        color = colors[controller]
        axes.fill_between(episodes, low, high, step='post', color=color, alpha=0.2, linewidth=0)
        axes.step(episodes, median, where='post', color=color, label=_label(controller, runs))
    axes.set(xlabel='episodes', ylabel='best v_x so far [m/s]')
    axes.grid(linewidth=0.4, alpha=0.5)
    axes.legend(fontsize=7.5)
    return figure


def median_curve(curves: Sequence[np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
    """Return episodes, (n,), and the quartiles of the best so far at each of them, (3, n).

    Args:
        curves: for each run, (n_points, 2) episodes and best so far, where it rises.
    """
    end = min(curve[-1, 0] for curve in curves)
    start = max(curve[0, 0] for curve in curves)
    points = np.unique(np.concatenate([curve[:, 0] for curve in curves]))
    points = points[(start <= points) & (points <= end)]
    best = [
        curve[np.searchsorted(curve[:, 0], points, side='right') - 1, 1] for curve in curves
    ]
    return points, quartiles(np.array(best))


def _draw_vibration(
    shape: str, of_shape: dict[ControllerType, list[Run]], colors: dict[ControllerType, str]
) -> tuple[str, str, Figure]:
    """Draw every run's share of vibration; return kind, shape and figure."""
    figure, axes = _draw_each(shape, of_shape, colors, 'vibration', VIBRATING_SHARE)
    axes.set_ylabel(f'power above {VIBRATION:g} Hz (share)')
    axes.set_ylim(-0.02, 1.02)
    return 'vibration', shape, figure


def _draw_frequencies(
    shape: str, of_shape: dict[ControllerType, list[Run]], colors: dict[ControllerType, str]
) -> tuple[str, str, Figure]:
    """Draw every run's dominant frequency; return kind, shape and figure."""
    figure, axes = _draw_each(shape, of_shape, colors, 'frequency', FAST_PEAK)
    axes.set_ylabel('dominant frequency [Hz]')
    axes.set_ylim(bottom=0.0)
    return 'frequency', shape, figure


def _draw_each(
    shape: str, of_shape: dict[ControllerType, list[Run]], colors: dict[ControllerType, str],
    column: str, line: float,
) -> tuple[Figure, Axes]:
    """Draw every run's value, sorted, and their median; boxes would hide gaps between gaits."""
    figure, axes = new_panel(shape, width=max(4.4, 0.75 * len(of_shape)))
    for place, (controller, runs) in enumerate(of_shape.items()):
        values = np.sort(column_of(runs, column))
        places = place + 0.6 * ((np.arange(len(runs)) + 0.5) / len(runs) - 0.5)
        axes.plot(places, values, 'o', color=colors[controller], markersize=4)
        axes.hlines(np.median(values), place - 0.36, place + 0.36, color=INK, linewidth=1.6)
    axes.axhline(line, color=INK, linewidth=0.8, linestyle=':')
    axes.set_xlim(-0.6, len(of_shape) - 0.4)
    axes.set_xticks(range(len(of_shape)), _ticks(of_shape))
    axes.grid(axis='y', linewidth=0.4, alpha=0.5)
    return figure, axes


def _draw_variance(
    shape: str, of_shape: dict[ControllerType, list[Run]], colors: dict[ControllerType, str]
) -> Figure:
    """Draw v_x at the end of evolution against v_x in the other engine and from pushed starts."""
    figure, axes = new_panel(shape, 4.0)
    for controller, runs in of_shape.items():
        own, color = column_of(runs, END), colors[controller]
        axes.plot(own, column_of(runs, OTHER_ENGINE), 'o', color=color, mfc='none', markersize=5)
        mean, spread = column_of(runs, PUSHED), column_of(runs, 'v_x_pushed_std')
        axes.errorbar(own, mean, spread, fmt='o', color=color, markersize=4.5, elinewidth=0.8,
                      label=_label(controller, runs))
    axes.axline((0.0, 0.0), slope=1.0, color=INK, linewidth=0.8, linestyle=':')
    axes.set(xlabel='v_x at the end of evolution [m/s]', ylabel='v_x elsewhere [m/s]')
    axes.grid(linewidth=0.4, alpha=0.5)
    axes.legend(fontsize=7.5)
    return figure


def _label(controller: ControllerType, runs: Sequence[Run]) -> str:
    return f'{controller}, n = {len(runs)}'
