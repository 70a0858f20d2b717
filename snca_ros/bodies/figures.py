"""The figure of an archive of bodies: a cell per size and number of feet, its elite drawn in it."""

from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.collections import PatchCollection
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from snca_ros.bodies.archive import ScoredBody
from snca_ros.bodies.grids import Frame
from snca_ros.evolution.tasks import Task
from snca_ros.figures import as_label, own_style

_CELL = 0.62  # inches
_INSIDE = 0.86  # part of the width of a cell in which bodies are drawn
_HEIGHT = 0.62  # likewise of its height; the score is written above
_COLORS, _EMPTY = 'GnBu', '#dddddd'
_LIGHT, _DARK = '#fafafa', '#101010'


@own_style()
def draw_archive(
    name: str, elites: Sequence[ScoredBody], frame: Frame, task: Task
) -> Figure:
    """Return a heat map of the scores of elites, with their bodies on one scale.

    Args:
        name: name of the controller.
        elites: the elites, one per cell.
        frame: limits of the bodies; possible cells without an elite are outlined.
        task: task of the scores.
    """
    width, height = _CELL * frame.voxels, _CELL * frame.most_feet
    figure = Figure(figsize=(max(width, 4.0) + 1.8, height + 1.1), layout='constrained')
    axes = figure.subplots()
    axes.add_collection(PatchCollection(
        [_square(cell) for cell in frame.cells], facecolor='none', edgecolor=_EMPTY, linewidth=0.6
    ))
    scores = np.array([one.score for one in elites] or [0.0])
    norm = Normalize(min(0.0, scores.min()), max(scores.max(), 1e-9))
    scale = _voxel_side(elites)
    for one in elites:
        share = float(norm(one.score))
        _draw_elite(axes, one, mpl.colormaps[_COLORS](share), _LIGHT if share > 0.6 else _DARK,
                    scale)
    axes.set(xlim=(0.4, frame.voxels + 0.6), ylim=(0.4, frame.most_feet + 0.6), aspect='equal')
    axes.set_xticks(range(1, frame.voxels + 1))
    axes.set_yticks(range(1, frame.most_feet + 1))
    axes.set(xlabel='size [voxels]', ylabel='feet')
    axes.tick_params(length=0, labelsize=8)
    axes.spines[:].set_visible(False)
    axes.set_title(_title(name, elites, frame), loc='left', fontsize=9)
    figure.colorbar(
        ScalarMappable(norm, _COLORS), ax=axes, label=f'mean {task.label}', fraction=0.05, pad=0.01
    )
    return figure


def _title(name: str, elites: Sequence[ScoredBody], frame: Frame) -> str:
    n_starts = len(elites[0].scores) if elites else 0
    return (
        f'{as_label(name)}: {len(elites)} of {len(frame.cells)} cells, '
        f'means over {n_starts} pushed starts'
    )


def _square(cell: tuple[int, int]) -> Rectangle:
    x, y = cell
    return Rectangle((x - 0.48, y - 0.48), 0.96, 0.96)


def _voxel_side(elites: Sequence[ScoredBody]) -> float:
    """Return the side of a voxel, relative to that of a cell, with which all bodies fit."""
    widest = max((one.body.width for one in elites), default=1)
    highest = max((one.body.height for one in elites), default=1)
    return min(_INSIDE / widest, _HEIGHT / highest)


def _draw_elite(
    axes: Axes, one: ScoredBody, color: tuple[float, ...], ink: str, side: float
) -> None:
    """Draw the cell of an elite, its score, and its body on the bottom of the cell."""
    x, y = one.cell
    axes.add_patch(Rectangle((x - 0.48, y - 0.48), 0.96, 0.96, facecolor=color))
    score = f'{round(one.score, 1) + 0.0:.1f}'  # not -0.0
    axes.text(x, y + 0.44, score, ha='center', va='top', color=ink, fontsize=7)
    left, bottom = x - side * one.body.width / 2, y - 0.44
    voxels = [
        Rectangle((left + i * side, bottom + j * side), side, side) for i, j in one.body.squares
    ]
    axes.add_collection(PatchCollection(
        voxels, facecolor=ink, edgecolor=color, linewidth=0.5
    ))
