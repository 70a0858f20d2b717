"""Figures of scores: per terrain, as a function of the value of a fault, and per body."""

from collections.abc import Sequence

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from snca_ros.assessment.fault_sweep import Sweep
from snca_ros.assessment.transfer import Transfer
from snca_ros.assessment.trials import summary
from snca_ros.evolution.tasks import Task
from snca_ros.figures import as_label, legend_above, own_style


@own_style()
def draw_scores(
    controllers: Sequence[str], terrains: Sequence[str], scores: np.ndarray, task: Task
) -> Figure:
    """Return a figure of scores per terrain; large dots are exact starts, small ones pushed starts.

    Args:
        controllers, terrains: their names.
        scores: (n_controllers, n_terrains, 1 + n_pushed).
        task: task of the scores.
    """
    n = len(controllers)
    figure = Figure(figsize=(7.0, 1.6 + len(terrains) * (0.2 + 0.1 * n)), layout='constrained')
    axes = figure.subplots()
    for i, (name, of_one) in enumerate(zip(controllers, scores, strict=True)):
        rows = np.arange(len(terrains)) + 0.6 * ((i + 0.5) / n - 0.5)
        color = f'C{i % 10}'
        for pushed in of_one.T[1:]:
            axes.plot(pushed, rows, '.', color=color, markersize=4, alpha=0.4)
        label = f'{as_label(name)}: mean {task.in_unit(of_one[:, 0].mean())}'
        axes.plot(of_one[:, 0], rows, 'o', color=color, markersize=6, label=label)
    axes.set_yticks(range(len(terrains)), terrains, fontsize=8)
    axes.invert_yaxis()
    axes.grid(axis='x', linewidth=0.5)
    axes.set_xlabel(task.label)
    legend_above(axes)
    return figure


@own_style()
def draw_sweeps(
    names: Sequence[str], sweeps: Sequence[Sweep], scores: Sequence[np.ndarray], task: Task
) -> Figure:
    """Return a figure with a panel per sweep: mean and standard deviation of scores over starts.

    Args:
        names: names of the controllers.
        sweeps: the sweeps.
        scores: (n_controllers, n_values, n_starts) for each sweep.
        task: task of the scores.
    """
    n_columns = min(3, len(sweeps))
    n_rows = -(-len(sweeps) // n_columns)
    figure = Figure(figsize=(0.8 + 2.6 * n_columns, 0.5 + 2.2 * n_rows), layout='constrained')
    panels = figure.subplots(n_rows, n_columns, sharey=True, squeeze=False).ravel()
    for axes in panels[len(sweeps) :]:
        axes.remove()
    for axes, sweep, of_sweep in zip(panels, sweeps, scores, strict=False):
        for i, of_one in enumerate(of_sweep):
            pairs = [summary(of_value.tolist()) for of_value in of_one]
            mean, std = np.array([p if np.isfinite(p).all() else (np.nan, np.nan) for p in pairs]).T
            color, label = f'C{i % 10}', as_label(names[i]) if axes is panels[0] else None
            axes.plot(sweep.values, mean, '.-', color=color, label=label)
            axes.fill_between(sweep.values, mean - std, mean + std, color=color, alpha=0.25)
        axes.axhline(0.0, color='0.55', linewidth=0.5)
        axes.grid(axis='y', linewidth=0.5)
        axes.set_xlabel(sweep.label, fontsize=8)
        axes.tick_params(labelsize=8)
    for axes in panels[::n_columns]:
        axes.set_ylabel(task.label, fontsize=8)
    legend_above(panels[0], 1.04)
    return figure


@own_style()
def draw_transfer(transfer: Transfer, means: np.ndarray, task: Task) -> Figure:
    """Return a heat map of mean scores of controllers in bodies; a frame marks the own body.

    Args:
        transfer: controllers in bodies.
        means: (n_controllers, n_bodies); NaN where a controller does not fit.
        task: task of the scores.
    """
    n_rows, n_columns = means.shape
    longest = max(map(len, transfer.names))
    size = 1.8 + 0.075 * longest + 0.75 * n_columns, 1.5 + 0.4 * n_rows
    figure = Figure(figsize=size, layout='constrained')
    axes = figure.subplots()
    finite = means[np.isfinite(means)]
    middle = (finite.min() + finite.max()) / 2.0 if len(finite) else 0.0
    axes.set_facecolor('0.9')
    image = axes.imshow(np.ma.masked_invalid(means), aspect='auto', cmap='viridis')
    for (i, j), mean in np.ndenumerate(means):
        dark = np.isfinite(mean) and mean < middle
        text = '–' if np.isnan(mean) else f'{mean:.2f}'
        axes.text(j, i, text, ha='center', va='center', fontsize=8, color='w' if dark else 'k')
        if transfer.home[i, j]:
            frame = Rectangle((j - 0.46, i - 0.45), 0.92, 0.9, fill=False, edgecolor='r')
            axes.add_patch(frame).set_linewidth(2.0)
    axes.set_xticks(range(n_columns), map(as_label, transfer.labels), fontsize=8, rotation=30,
                    ha='right', rotation_mode='anchor')
    axes.set_yticks(range(n_rows), map(as_label, transfer.names), fontsize=8)
    figure.colorbar(image, label=task.label)
    return figure
