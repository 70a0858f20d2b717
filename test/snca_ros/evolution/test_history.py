"""Histories of runs: described, drawn, watched while they grow; damage is named."""

import contextlib
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from PIL import Image

from sim_node.errors import InvalidInput
from snca_ros.bundled import bundled_controllers
from snca_ros.cell.architecture import Architecture
from snca_ros.cli import main
from snca_ros.command_line import BAD_INPUT
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.checkpoint_arrays import HISTORY
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.figures import draw_histories
from snca_ros.evolution.history import describe, read_history
from snca_ros.evolution.workers import IN_PROCESS

CONFIG = RunConfig(
    '11', Architecture.named('U-D', 'mlp'), episodes=10, population=4, duration=0.2,
    transient=0.0,
)


class Stopped(Exception):
    pass


def go_on(path, generations):
    """Let a run go on for so many generations; return where it stands."""
    folder, left = RunFolder.create_or_resume(path, CONFIG), iter(range(generations - 1))

    def report(progress):
        if next(left, None) is None:
            raise Stopped

    with contextlib.closing(folder), contextlib.suppress(Stopped):
        evolve(folder, IN_PROCESS, report)


def test_a_run_folder_and_its_file_are_told(tmp_path, capsys):
    go_on(tmp_path / 'run', 2)
    history = read_history(tmp_path / 'run')
    assert (history.episodes, history.total, history.finished) == (7, 10, False)
    assert history.rows.shape == (2, len(HISTORY))
    best = history.rows[-1, -1]
    assert best == history.rows[:, 2].max()
    assert main(['history', str(tmp_path / 'run'), str(tmp_path / 'run' / 'history.csv')]) == 0
    output = capsys.readouterr().out
    assert f'run: 7 of 10 episodes, best {best:.3f} m/s' in output
    assert f'history.csv: 7 episodes, best {best:.3f} m/s' in output
    assert 'generation 1: ' in output


def test_a_run_without_a_generation(tmp_path, capsys):
    RunFolder.create(tmp_path / 'run', CONFIG).close()
    figure = tmp_path / 'figure.svg'
    assert main(['history', str(tmp_path / 'run'), '--figure', str(figure)]) == 0
    assert capsys.readouterr().out == f'{tmp_path / "run"}: no generation yet\n'
    assert figure.exists()


def test_watching_draws_every_generation_until_the_end(tmp_path, monkeypatch, capsys):
    run, figure, drawn = tmp_path / 'run', tmp_path / 'figure.png', []
    RunFolder.create(run, CONFIG).close()

    def a_second(_):
        drawn.append(figure.read_bytes())
        go_on(run, 1)

    monkeypatch.setattr('snca_ros.commands.history.time.sleep', a_second)
    assert main(['history', str(run), '--watch', '--figure', str(figure)]) == 0
    assert len(drawn) == 3  # of 4, 3 and 3 episodes
    assert len({*drawn, figure.read_bytes()}) == 4
    output = capsys.readouterr().out
    assert output.startswith(f'{run}: 10 of 10 episodes')  # no terminal: the end alone
    assert '\x1b' not in output


def test_watching_on_a_terminal_draws_over_what_it_drew(tmp_path, monkeypatch):
    class Screen(io.StringIO):
        def isatty(self):
            return True

    monkeypatch.setenv('COLUMNS', '30')
    monkeypatch.setattr('sys.stdout', screen := Screen())
    monkeypatch.setattr(
        'snca_ros.commands.history.time.sleep', lambda _: go_on(tmp_path / 'run', 1)
    )
    go_on(tmp_path / 'run', 2)
    assert main(['history', str(tmp_path / 'run'), '--watch']) == 0
    first, second = screen.getvalue().split('\x1b[6F\x1b[J')  # up by the six lines of a run
    assert len(first.splitlines()) == len(second.splitlines()) == 6
    assert max(map(len, first.splitlines())) == 30


def test_a_figure_has_best_median_and_range_of_each_run(tmp_path):
    table = np.array([[0, 4, 1.0, 0.5, -np.inf, 1.0], [1, 7, 0.8, 0.6, 0.1, 1.0]])
    (axes,) = draw_histories(['one', 'two'], [table, table + 1], 'rise [m]').axes
    assert axes.get_ylabel() == 'rise [m]'
    median, best = axes.lines[:2]
    np.testing.assert_array_equal(median.get_xydata(), table[:, [1, 3]])
    np.testing.assert_array_equal(best.get_xydata(), table[:, [1, 5]])
    assert len(axes.collections) == 2


def test_the_history_in_the_box(tmp_path, capsys):
    path = bundled_controllers()['biped-U-nD-snn-h'].with_suffix('.csv')
    assert main(['history', str(path), '--figure', str(tmp_path / 'history.png')]) == 0
    assert '30000 episodes, best ' in capsys.readouterr().out
    with Image.open(tmp_path / 'history.png') as figure:
        assert figure.size[0] > 600


@pytest.mark.parametrize('text', [
    '', 'a,b\n', ','.join(HISTORY) + '\n0,36,1\n', ','.join(HISTORY) + '\n0,36,a,b,c,d\n',
    ','.join(HISTORY) + '\n0,36,1,1,1,1\n1,36,1,1,1,1\n', '\0',
])
def test_damaged_histories_are_named(tmp_path, capsys, text):
    path = tmp_path / 'history.csv'
    path.write_text(text)
    assert main(['history', str(path)]) == BAD_INPUT
    error = capsys.readouterr().err
    assert error.startswith(f'snca history: error: {path}: ')
    assert error.count('\n') == 1


@given(st.binary(max_size=200) | st.text(max_size=200).map(str.encode))
def test_any_file_is_read_or_refused(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / 'any.csv'
    path.write_bytes(','.join(HISTORY).encode() + b'\n' + content)
    with contextlib.suppress(InvalidInput):
        describe(read_history(path))


def test_what_is_no_run_is_named(tmp_path, capsys):
    for path in (tmp_path, tmp_path / 'nowhere'):
        assert main(['history', str(path)]) == BAD_INPUT
        assert 'run' in capsys.readouterr().err
    go_on(tmp_path / 'run', 1)
    assert main(['history', str(tmp_path / 'run'), '--figure', 'a.nothing']) == BAD_INPUT
    assert 'figure' in capsys.readouterr().err
