"""How the figures of a study look, and their text as SVG."""

import io
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

INK, PAPER = '#1a1a1a', '#ffffff'
"""Colours of what a page may draw light on dark instead."""

STYLE: dict[Any, Any] = {
    'font.size': 9.0, 'svg.fonttype': 'none', 'svg.hashsalt': 'snca_ros',
    'text.color': INK, 'axes.edgecolor': INK, 'axes.labelcolor': INK, 'xtick.color': INK,
    'ytick.color': INK, 'figure.facecolor': PAPER, 'axes.facecolor': PAPER,
    'legend.facecolor': PAPER, 'axes.titlesize': 10.0, 'axes.titlelocation': 'left',
}
"""Settings of matplotlib in which figures are drawn and written."""

_NO_METADATA = ('Creator', 'Date', 'Format', 'Type')


def svg_text(figure: Figure) -> str:
    """Return a figure as SVG, the same text for the same figure."""
    text = io.StringIO()
    figure.savefig(text, format='svg', metadata=dict.fromkeys(_NO_METADATA))
    return text.getvalue()


def new_panel(shape: str, height: float = 3.4, width: float = 4.4) -> tuple[Figure, Axes]:
    """Return a figure of so many inches with one panel, which has the name of a shape."""
    figure = Figure(figsize=(width, height), layout='constrained')
    axes = figure.subplots()
    axes.set_title(shape)
    axes.spines[['top', 'right']].set_visible(False)
    axes.set_axisbelow(True)
    return figure, axes
