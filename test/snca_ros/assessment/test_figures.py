"""Figures of scores, from made-up numbers: no episode is run."""

import numpy as np
import pytest

from snca_ros.assessment.fault_sweep import parse_sweep
from snca_ros.assessment.figures import draw_scores, draw_sweeps
from snca_ros.evolution.tasks import TASKS
from snca_ros.figures import write_figure

WALK = TASKS['walk']


@pytest.mark.parametrize('suffix', ['svg', 'png'])
def test_figures_name_what_they_show(tmp_path, suffix):
    rng, terrains = np.random.default_rng(0), ['flat', 'uphill-10']
    sweeps = [parse_sweep(text) for text in ('loss=0..0.9..0.3', 'delay=0..2')]
    of_sweeps = [rng.normal(size=(2, len(sweep.values), 4)) for sweep in sweeps]
    of_sweeps[0][0, 1, 2] = -np.inf  # an episode diverged
    for name, figure in {
        'scores': draw_scores(['one', 'two'], terrains, rng.normal(size=(2, 2, 4)), WALK),
        'sweeps': draw_sweeps(['one', 'two'], sweeps, of_sweeps, WALK),
    }.items():
        path = tmp_path / f'{name}.{suffix}'
        write_figure(figure, path)
        assert path.stat().st_size > 1000
        if suffix == 'svg':
            shown = terrains if name == 'scores' else [sweep.label for sweep in sweeps]
            assert all(f'<!-- {text} -->' in path.read_text() for text in [*shown, 'v_x [m/s]'])
