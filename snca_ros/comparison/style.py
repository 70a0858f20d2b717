"""Style of the figures of a study, and their output as SVG."""

import io
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

INK, PAPER = '#1a1a1a', '#ffffff'
"""Colours of text and background, which the page replaces by those of its colour scheme."""

STYLE: dict[Any, Any] = {
    'font.size': 9.0, 'svg.fonttype': 'none', 'svg.hashsalt': 'snca_ros',
    'text.color': INK, 'axes.edgecolor': INK, 'axes.labelcolor': INK, 'xtick.color': INK,
    'ytick.color': INK, 'figure.facecolor': PAPER, 'axes.facecolor': PAPER,
    'legend.facecolor': PAPER, 'axes.titlesize': 10.0, 'axes.titlelocation': 'left',
}
"""Settings of matplotlib for drawing and writing figures."""

_NO_METADATA = ('Creator', 'Date', 'Format', 'Type')


def svg_text(figure: Figure) -> str:
    """Return a figure as SVG text, which is the same for the same figure."""
    text = io.StringIO()
    figure.savefig(text, format='svg', metadata=dict.fromkeys(_NO_METADATA))
    return text.getvalue()


def new_panel(shape: str, height: float = 3.4, width: float = 4.4) -> tuple[Figure, Axes]:
    """Return a figure with one panel, whose title is a shape; height and width are in inches."""
    figure = Figure(figsize=(width, height), layout='constrained')
    axes = figure.subplots()
    axes.set_title(shape)
    axes.spines[['top', 'right']].set_visible(False)
    axes.set_axisbelow(True)
    return figure, axes
