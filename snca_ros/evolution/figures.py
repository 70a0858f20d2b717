"""Figures of the histories of runs."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure

from snca_ros.figures import as_label, legend_above, own_style


@own_style()
def draw_histories(
    names: Sequence[str], tables: Sequence[np.ndarray], label: str
) -> Figure:
    """Return a figure of runs: best score so far, and median and range of each generation.

    Args:
        names: names of the runs.
        tables: (n_generations, 6) columns of history.csv, for each run.
        label: label of the score axis, such as 'v_x [m/s]'.
    """
    figure = Figure(figsize=(7.0, 4.0 + 0.15 * len(names)), layout='constrained')
    axes = figure.subplots()
    for i, (name, table) in enumerate(zip(names, tables, strict=True)):
        _, episodes, best, median, worst, best_so_far = np.where(
            np.isfinite(table), table, np.nan
        ).T
        color = f'C{i % 10}'
        axes.fill_between(episodes, worst, best, color=color, alpha=0.12, linewidth=0)
        axes.plot(episodes, median, color=color, linewidth=0.8)
        axes.step(
            episodes, best_so_far, where='post', color=color, linewidth=1.8,
            label=as_label(name),
        )
    axes.set(xlabel='episodes', ylabel=label)
    axes.set_title('best so far (bold), median and range of a generation', loc='left', fontsize=9)
    axes.grid(linewidth=0.4, alpha=0.5)
    legend_above(axes, 1.07)
    return figure
