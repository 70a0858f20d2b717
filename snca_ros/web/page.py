"""Builds the page of a walk: one HTML file without external resources."""

import html
import json
from collections.abc import Sequence
from importlib import resources
from string import Template
from typing import Any

import numpy as np

from sim_node.control_time import CONTROL_RATE, MARKER_PERIOD
from sim_node.model.terrain import Terrain
from snca_ros.recording.bag import Recording
from snca_ros.recording.gait import measure_gait
from snca_ros.trained_controller import TrainedController
from snca_ros.web.frames import Frames, make_frames

_STYLES = ('uplot/uPlot.min.css', 'page.css')
_SCRIPTS = (
    'uplot/uPlot.iife.min.js', 'walk.js', 'stage.js', 'raster.js', 'spans.js', 'plots.js',
    'player.js', 'live.js', 'main.js',
)

_LEGEND = """
<span><i class="area"></i>area: contracted, at rest, expanded</span>
<span><i class="touch"></i>touches the ground</span>
<span><i class="command"></i>inner square: actuation, small to contract, large to expand</span>
<span><i class="limp"></i>limp: no answer of the voxel counts</span>
<span><i class="held"></i>its answer or message did not come in time, it holds the last one</span>
<span><i class="late"></i>spikes that came too late to count</span>
"""


def walk_page(
    recording: Recording,
    title: str,
    *,
    facts: Sequence[str] = (),
    thresholds: np.ndarray | None = None,
    directional: bool | None = None,
    history: dict[str, list[float | None]] | None = None,
    history_label: str = '',
) -> str:
    """Return the HTML of a page that plays a walk.

    Args:
        recording: the walk, of a bag or of `record_offline`.
        title: of the page.
        facts: lines below the title, shown above the measures of the gait.
        thresholds: (n_steps, n_voxels) [mV]; None if they are unknown.
        directional: whether cells send different messages to each side; None if it is unknown.
        history: of the evolution, columns of history.csv by name.
        history_label: quantity and unit of its scores, such as 'v_x [m/s]'.

    Raises:
        InvalidInput: the recording has no poses.
    """
    frames = make_frames(recording, thresholds)
    spiking = recording.spikes is not None
    messages = recording.spikes if spiking else recording.values
    header = {
        'rate': CONTROL_RATE, 'stride': frames.stride, 'steps': recording.n_steps,
        'voxels': recording.voxel_names, 'ground': frames.ground.T.tolist(), 'spiking': spiking,
        'channelCount': 0 if messages is None else messages.shape[2],
        'directional': bool(directional), 'arrays': frames.describe(), 'history': history,
        'historyLabel': history_label,
    }
    return _render_template(
        title, header, [*facts, _gait(recording)], _notes(recording, frames), frames.encode()
    )


def live_page(trained: TrainedController, terrain: Terrain, title: str) -> str:
    """Return the HTML of a page that shows the frames which a `PageServer` sends."""
    cells = trained.architecture
    header = {
        'live': True, 'rate': CONTROL_RATE, 'voxels': trained.morphology.voxel_names,
        'ground': [terrain.x.tolist(), terrain.y.tolist()], 'spiking': cells.spiking,
        'channelCount': cells.n_destinations * cells.n_c, 'directional': cells.directional,
    }
    notes = [
        'The page shows 30 frames per second of wall time, and all messages between voxels.',
        'Plots are means over the last second: each voxel in grey, the mean of all, and the '
        'selected voxel.',
        'A cross marks a voxel whose node reports an error or is dead, a stroke one whose node '
        'reports a warning.',
    ]
    return _render_template(title, header, ['Live'], notes)


def _render_template(
    title: str, header: dict[str, Any], facts: Sequence[str], notes: Sequence[str], frames: str = ''
) -> str:
    """Return the page; its scripts read `header` and `frames`."""
    return Template(_asset('page.html')).substitute(
        title=html.escape(title), facts=_paragraphs(facts), notes=_paragraphs(notes),
        messages='Spikes sent by voxels' if header['spiking'] else 'Values sent by voxels',
        legend=_LEGEND,
        history=_HISTORY if header.get('history') else '',
        # A "</script>" in the header would end its element.
        header=json.dumps(header).replace('<', '\\u003c'),
        frames=frames,
        style='\n'.join(map(_asset, _STYLES)),
        script='\n'.join(map(_asset, _SCRIPTS)),
    )


def _paragraphs(lines: Sequence[str]) -> str:
    return ''.join(f'<p>{html.escape(line)}</p>' for line in lines)


_HISTORY = (
    '<section><h2>Evolution: best so far, best and median of a generation</h2>'
    '<div id="plot-history"></div></section>'
)


def _asset(name: str) -> str:
    return resources.files(__package__).joinpath('static', name).read_text(encoding='utf-8')


def _gait(recording: Recording) -> str:
    gait = measure_gait(recording)
    facts = [
        f'v_x {gait.velocity:.3f} m/s ({gait.scored})',
        f'{gait.distance:.1f} m in {gait.duration:.1f} s', f'rhythm {gait.frequency:.2f} Hz',
        *gait.walls.describe(),
    ]
    return ', '.join(facts)


def _unheard(recording: Recording) -> str:
    """Return a note about late and unsent messages; empty if there are none."""
    late = sum(len(count.late) for count in recording.counts)
    unsent = sum(len(count.unsent) for count in recording.counts)
    if not late and not unsent:
        return ''
    return (
        f'{late} messages came too late to count, and {unsent} were never sent: the strip above '
        'the slider shows when, of the selected voxel or of all. Firing rates count only messages '
        'that came in time.'
    )


def _notes(recording: Recording, frames: Frames) -> list[str]:
    """Return notes about what the page omits, averages or interpolates."""
    every = frames.stride / CONTROL_RATE
    notes = [
        f'Robot and plots have a frame every {frames.stride} control steps ({every:.3f} s)'
        f'{"" if frames.stride == MARKER_PERIOD else ", thinned because the walk is long"};'
        ' between frames the page interpolates. It shows all messages between voxels.',
        'Plots are means over one second: each voxel in grey, the mean of all, and the selected '
        'voxel.'
    ]
    unheard = _unheard(recording)
    if unheard:
        notes.append(unheard)
    missing = sum(len(c.missing) for c in recording.counts if c.missing is not None)
    if missing:
        notes.append(f'{missing} messages are missing in the bag. They appear as gaps, except that '
                     "the robot's position is interpolated.")
    if not recording.closed:
        notes.append('The recorder did not close this bag: the page shows what it had written.')
    if recording.n_episodes > 1:
        notes.append(f'Episode {recording.episode} of 0 to {recording.n_episodes - 1} (resets).')
    return notes
