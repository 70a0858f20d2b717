"""Draws a recorded walk: trajectory, area ratios, and messages, with spans of limp voxels."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.image import AxesImage

from sim_node.control_time import CONTROL_RATE, steps_in
from snca_ros.figures import own_style
from snca_ros.recording.bag import Recording
from snca_ros.recording.gait import area_ratios, spike_times
from snca_ros.recording.outcomes import Outcome

WINDOW = 4.0
"""Length of the end of the walk that the lower panels show [s]."""

_BLUE, _GREY, _LATE = '#0072B2', '0.55', '#B9A48A'
_SHADES = {Outcome.LIMP: '#C77FB0', Outcome.HELD: '#F0DCEA'}
_AREA_RANGE = 0.25


@own_style()
def draw_recording(recording: Recording) -> Figure:
    """Return a figure of trajectory, area ratios and raster of messages.

    The last two show only the end of the walk, so that single spikes are visible. If any voxel was
    limp or held an older answer, a panel shows when, over the whole walk.
    """
    n_rows = min(len(recording.voxel_names), 40)
    disturbed = np.isin(recording.outcomes, [*_SHADES]).any()
    extra = 0.6 + 0.15 * n_rows if disturbed else 0.0
    figure = Figure(figsize=(10.0, 3.6 + 0.55 * n_rows + extra), layout='constrained')
    heights = [2.0, 0.6 + 0.2 * n_rows, 0.6 + 0.35 * n_rows, *([extra] if disturbed else [])]
    trajectory, areas, messages, *spans = figure.subplots(len(heights), 1, height_ratios=heights)
    for axes in spans:
        _draw_spans(axes, recording)
    first = max(0, recording.n_steps - 1 - steps_in(WINDOW))
    _draw_trajectory(trajectory, recording)
    _draw_areas(areas, recording, first)
    _draw_messages(messages, recording, first)
    for axes in (areas, messages):
        axes.set_xlim(first / CONTROL_RATE, max(1, recording.n_steps - 1) / CONTROL_RATE)
    areas.tick_params(labelbottom=False)
    messages.set_xlabel('time [s]')
    return figure


def _draw_trajectory(axes: Axes, recording: Recording) -> None:
    x, y = recording.centers.T
    axes.plot(x, y, color=_BLUE, linewidth=1.0)
    every = 5 * CONTROL_RATE * (1 + len(x) // (60 * CONTROL_RATE))
    marks = np.arange(0, len(x), every)
    axes.plot(x[marks], y[marks], 'o', color=_BLUE, markersize=4)
    for k in marks:
        if np.isfinite(x[k]):
            axes.annotate(
                f'{k // CONTROL_RATE} s', (x[k], y[k]), xytext=(3, 4),
                textcoords='offset points', fontsize=8,
            )
    axes.margins(y=0.25)
    axes.set(xlabel='x [m]', ylabel='height [m]')
    axes.set_title(f'{recording.robot}: trajectory of the centre', loc='left')


def _draw_areas(axes: Axes, recording: Recording, first: int) -> None:
    ratios = area_ratios(recording.readings[first:], recording.sensors)
    image = _draw_rows(axes, ratios, first, 1.0 - _AREA_RANGE, 1.0 + _AREA_RANGE)
    axes.figure.colorbar(image, ax=axes, label='area / area at rest', extend='both', pad=0.01)
    axes.set_yticks(range(ratios.shape[1]), recording.voxel_names, fontsize=8)
    axes.set_title('Area ratios of the voxels', loc='left')


def _draw_spans(axes: Axes, recording: Recording) -> None:
    """Draw when each voxel was limp or held an older answer, over the whole walk."""
    _shade(axes, recording, 0, 1)
    axes.set_yticks(range(len(recording.voxel_names)), recording.voxel_names, fontsize=8)
    axes.set_ylim(-0.5, len(recording.voxel_names) - 0.5)
    axes.set_xlim(0.0, max(1, recording.n_steps - 1) / CONTROL_RATE)
    axes.set_xlabel('time [s]')
    axes.set_title('Voxels that were limp (dark) or held an older answer (light)', loc='left')


def _shade(axes: Axes, recording: Recording, first: int, n_channels: int) -> None:
    """Shade the steps at which a voxel was limp or held an older answer, in its rows."""
    for outcome, color in _SHADES.items():
        for i, matches in enumerate((recording.outcomes[first:] == outcome).T):
            edges = np.flatnonzero(np.diff(matches.astype(np.int8), prepend=0, append=0))
            begin, end = (first + edges.reshape(-1, 2).T) / CONTROL_RATE
            axes.broken_barh(
                list(zip(begin, end - begin, strict=True)), (i * n_channels - 0.5, n_channels),
                color=color, linewidth=0, zorder=0,
            )


def _draw_messages(axes: Axes, recording: Recording, first: int) -> None:
    """Draw spikes, or values where cells send values, from step `first` on."""
    n_voxels, n_channels = len(recording.voxel_names), 1
    title = 'No messages between voxels'
    if recording.spikes is not None:
        n_channels = recording.spikes.shape[2]
        size = max(1.5, 130.0 / (n_voxels * n_channels))
        late = recording.late[first:, :, None, None]
        for which, color in ((~late, 'black'), (late, _LATE)):
            times, row = spike_times(recording.spikes[first:] * which)
            axes.plot(
                first / CONTROL_RATE + times, row, '|', color=color, rasterized=True,
                markersize=size, markeredgewidth=0.6,
            )
        _shade(axes, recording, first, n_channels)
        title = f'Spikes that the voxels send, {n_channels} channels each'
        title += '; late ones are pale' if late.any() else ''
    elif recording.values is not None:
        n_channels = recording.values.shape[2]
        values = np.where(recording.late[first:, :, None], np.nan, recording.values[first:])
        image = _draw_rows(axes, values.reshape(len(values), -1), first, -1.0, 1.0)
        axes.figure.colorbar(image, ax=axes, label='value', pad=0.01)
        title = f'Values that came in time, {n_channels} channels each'
    for edge in range(1, n_voxels):
        axes.axhline(edge * n_channels - 0.5, color=_GREY, linewidth=0.5)
    middles = n_channels * (np.arange(n_voxels) + 0.5) - 0.5
    axes.set_yticks(middles, recording.voxel_names, fontsize=8)
    axes.set_ylim(-0.5, n_voxels * n_channels - 0.5)
    axes.set_title(title, loc='left')


def _draw_rows(
    axes: Axes, numbers: np.ndarray, first: int, low: float, high: float
) -> AxesImage:
    """Draw (n_steps, n_rows) numbers as rows of colours; grey where a number is NaN."""
    n_steps, n_rows = numbers.shape
    axes.set_facecolor(_GREY)
    return axes.imshow(
        numbers.T, aspect='auto', origin='lower', cmap='PuOr', interpolation='nearest',
        vmin=low, vmax=high,
        extent=(first / CONTROL_RATE, (first + n_steps) / CONTROL_RATE, -0.5, n_rows - 0.5),
    )
