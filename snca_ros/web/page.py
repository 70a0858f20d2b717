"""The page of a walk: one HTML file that needs nothing else."""

import html
import json
from collections.abc import Sequence
from importlib import resources
from string import Template
from typing import Any

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.model.terrain import Terrain
from snca_ros.controller_file import TrainedController
from snca_ros.evolution.episode import TRANSIENT
from snca_ros.recording.bag import Recording
from snca_ros.recording.gait import measure_gait
from snca_ros.web.frames import FRAME_STEPS, Frames, make_frames

_STYLES = ('uplot/uPlot.min.css', 'page.css')
_SCRIPTS = (
    'uplot/uPlot.iife.min.js', 'walk.js', 'stage.js', 'raster.js', 'plots.js', 'player.js',
    'live.js', 'main.js',
)

_LEGEND = """
<span><i class="area"></i>area: contracted, at rest, expanded</span>
<span><i class="touch"></i>touches the ground</span>
<span><i class="command"></i>inner square: what the cell commands, small to contract</span>
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
    """Return the HTML that plays a walk.

    Args:
        recording: the walk, of a bag or of `record_offline`.
        title: of the page.
        facts: lines below the title, besides those of the gait.
        thresholds: (n_steps, n_voxels) [mV], if they are known.
        directional: whether cells send each side something else; None if nobody knows.
        history: of the evolution, columns of history.csv by name.
        history_label: quantity and unit of its scores, such as 'v_x [m/s]'.

    Raises:
        InvalidInput: the recording holds no poses.
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
    return _filled(
        title, header, [*facts, _gait(recording)], _notes(recording, frames), frames.encode()
    )


def live_page(trained: TrainedController, terrain: Terrain, title: str) -> str:
    """Return the HTML that shows a walk as a `PageServer` tells it."""
    cells = trained.architecture
    header = {
        'live': True, 'rate': CONTROL_RATE, 'voxels': trained.morphology.voxel_names,
        'ground': [terrain.x.tolist(), terrain.y.tolist()], 'spiking': cells.spiking,
        'channelCount': cells.n_destinations * cells.n_c, 'directional': cells.directional,
    }
    notes = [
        'Frames come 30 times a second of wall time; messages are shown in full.',
        'Plots are means over the second before: of all voxels in grey, of their mean, of the '
        'chosen one.',
        'A cross is a voxel whose node is dead, a stroke one whose node complains.',
    ]
    return _filled(title, header, ['Live'], notes)


def _filled(
    title: str, header: dict[str, Any], facts: Sequence[str], notes: Sequence[str], frames: str = ''
) -> str:
    """Return the page; `header` and `frames` are what its scripts read."""
    return Template(_asset('page.html')).substitute(
        title=html.escape(title), facts=_paragraphs(facts), notes=_paragraphs(notes),
        messages='Spikes that voxels send' if header['spiking'] else 'Values that voxels send',
        legend=_LEGEND,
        history=_HISTORY if header.get('history') else '',
        # "<" would end the element that holds it
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
    scored = f' after the first {TRANSIENT:g} s' if gait.duration > TRANSIENT else ''
    return (
        f'v_x {gait.velocity:.3f} m/s{scored}, {gait.distance:.1f} m in {gait.duration:.1f} s, '
        f'rhythm {gait.frequency:.2f} Hz'
    )


def _notes(recording: Recording, frames: Frames) -> list[str]:
    """Return what the page leaves out or fills in."""
    every = frames.stride / CONTROL_RATE
    notes = [
        f'Robot and plots have a frame every {frames.stride} control steps ({every:.3f} s)'
        f'{"" if frames.stride == FRAME_STEPS else ", thinned for display, the walk being long"};'
        ' between frames the page draws the line between them. Messages are shown in full.',
        'Plots are means over one second: of all voxels in grey, of their mean, of the chosen one.'
    ]
    lost = sum(count.lost for count in recording.counts)
    if lost:
        notes.append(f'{lost} messages are not in the bag: gaps, except that the place of the '
                     'robot is on the line between those known.')
    if not recording.closed:
        notes.append('The recorder did not finish this bag: what it had written is shown.')
    if recording.n_episodes > 1:
        notes.append(f'Episode {recording.episode} of 0 to {recording.n_episodes - 1} (resets).')
    return notes
