"""Figures have our style and any names, whatever matplotlib's settings of the user are."""

import io
import os
import subprocess
import sys

import matplotlib as mpl
import numpy as np
import pytest
from support.limits import LIMIT
from support.paths import ROOT

from snca_ros.assessment.figures import draw_scores
from snca_ros.evolution.figures import draw_histories
from snca_ros.evolution.tasks import TASKS
from snca_ros.figures import write_figure

NAMES = ['_$a$_$', 'c\udcff.npz']
STRANGE = {
    'text.usetex': True, 'savefig.transparent': True, 'lines.linewidth': 9.0,
    'axes.prop_cycle': mpl.cycler('color', ['black']), 'font.size': 20.0,
    'savefig.bbox': 'tight', 'axes.facecolor': 'red',
}


def scores(path):
    values = np.array([[[0.1, 0.2]], [[0.3, -0.4]]])
    write_figure(draw_scores(NAMES, ['flat'], values, TASKS['walk']), path)


def histories(path):
    table = np.array([[0.0, 4.0, 0.3, 0.1, -np.inf, 0.3], [1.0, 8.0, 0.5, 0.2, 0.0, 0.5]])
    write_figure(draw_histories(NAMES, [table, table], 'v_x [m/s]'), path)


@pytest.mark.parametrize('draw', [scores, histories])
def test_settings_of_the_user_change_no_figure(draw, tmp_path):
    with mpl.rc_context():
        mpl.rcdefaults()
        draw(tmp_path / 'usual.png')
    with mpl.rc_context():
        mpl.rcParams.update(STRANGE)
        draw(tmp_path / 'strange.png')
        assert mpl.rcParams['lines.linewidth'] == 9.0
    images = [(tmp_path / f'{name}.png').read_bytes() for name in ('usual', 'strange')]
    assert images[0] == images[1]


def test_names_are_labels_as_they_are():
    axes = draw_scores(NAMES, ['flat'], np.zeros((2, 1, 1)), TASKS['walk']).axes[0]
    labels = [text.get_text() for text in axes.get_legend().get_texts()]
    assert labels == [' _$a$_$: mean 0.000 m/s', 'c\\udcff.npz: mean 0.000 m/s']
    assert not any(text.get_parse_math() for text in axes.get_legend().get_texts())
    axes.figure.savefig(io.BytesIO())


def test_the_backend_of_a_notebook_is_not_needed():
    program = "from snca_ros import cli; cli.main(['--version']); import matplotlib.figure"
    subprocess.run(
        [sys.executable, '-c', program], check=True, timeout=LIMIT, stdout=subprocess.DEVNULL,
        env={**os.environ, 'PYTHONPATH': str(ROOT), 'MPLBACKEND': 'module://no_such.backend'},
    )
