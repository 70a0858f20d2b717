"""Style of figures, writing figures to files, and legends."""

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.backend_bases import FigureCanvasBase
from matplotlib.figure import Figure

from sim_node.errors import InvalidInput
from snca_ros.files import check_writable, write_atomically


@contextlib.contextmanager
def own_style(settings: dict[Any, Any] | None = None) -> Iterator[None]:
    """Draw or write a figure in matplotlib's default style, whatever the user's settings are.

    Also a decorator. Names of files are shown as they are: a `$` in them begins no formula.

    Args:
        settings: further settings of matplotlib.
    """
    with mpl.rc_context():
        mpl.rcdefaults()
        mpl.rcParams.update({'text.parse_math': False, **(settings or {})})
        yield


def as_label(name: str) -> str:
    """Return the name of a file as a label, with escape sequences where it is not UTF-8."""
    text = name.encode(errors='backslashreplace').decode()
    return f' {text}' if text.startswith('_') else text  # matplotlib hides labels that do


def check_figure(path: Path) -> str:
    """Return the file format for the suffix of `path`.

    Raises:
        InvalidInput: the suffix is unknown, or `path` cannot be written.
    """
    kinds, kind = FigureCanvasBase.get_supported_filetypes(), path.suffix[1:].lower()
    if kind not in kinds:
        raise InvalidInput('figure', str(path), f'a name that ends in .{", .".join(kinds)}')
    check_writable('figure', path)
    return kind


def write_figure(figure: Figure, path: Path) -> None:
    """Write `figure` to `path`, atomically, in the format of its suffix.

    Raises:
        InvalidInput: `path` has an unknown suffix or cannot be written.
    """
    kind = check_figure(path)
    try:
        with own_style():
            write_atomically(path, lambda file: figure.savefig(file, format=kind, dpi=120))
    except OSError as error:
        shown = f'{path}: {error.strerror}'
        raise InvalidInput('figure', shown, 'a file that can be written') from None


def legend_above(axes: Axes, at: float = 1.01) -> None:
    """Place the legend of a panel above it, aligned with its left side.

    matplotlib before 3.7 does not reserve space for the legend of a figure, so the legend belongs
    to a panel.

    Args:
        axes: the panel.
        at: vertical position of the legend, relative to the height of the panel.
    """
    axes.legend(loc='lower left', bbox_to_anchor=(0.0, at), borderaxespad=0.0, fontsize=8)
