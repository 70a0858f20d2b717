"""How far a command is: charts of characters, one line on a terminal, few lines elsewhere."""

import io
import os

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from snca_ros.commands.evolve import ProgressLine
from snca_ros.evolution.run_progress import Progress
from snca_ros.evolution.tasks import TASKS
from snca_ros.progress import StatusLine, bars, fit

NUMBERS = arrays(float, st.integers(1, 50), elements=st.floats(-1e9, 1e9) | st.just(-np.inf))


class Screen(io.StringIO):
    def isatty(self) -> bool:
        return True


def become_terminal(monkeypatch, columns):
    """Make standard error a terminal; return it."""
    monkeypatch.setenv('COLUMNS', str(columns))
    monkeypatch.setattr('sys.stderr', screen := Screen())
    return screen


def progress(*rows):
    """Return a run with these (best, median, worst) of generations of 10."""
    best = np.maximum.accumulate([row[0] for row in rows])
    return Progress(history=[(i, 10.0 * (i + 1), *row, best[i]) for i, row in enumerate(rows)])


@given(NUMBERS, st.integers(1, 60), st.integers(1, 5))
def test_bars_are_as_high_as_their_numbers(values, width, height):
    lines = bars(values, width, height)
    assert len(lines) == height
    assert {len(line) for line in lines} == {width}
    shown = values[np.linspace(0, len(values) - 1, width).round().astype(int)]
    tops = np.array([''.join(column) for column in zip(*reversed(lines), strict=True)])
    heights = np.array([sum(' ▁▂▃▄▅▆▇█'.index(c) for c in top) for top in tops])
    assert (np.diff(heights[np.argsort(shown)]) >= 0).all()
    assert 1 <= heights.min() <= heights.max() <= 8 * height


def test_bars_of_known_numbers():
    assert bars(np.array([0.0, 1.0, 7.0]), 3) == ['▁▂█']
    assert bars(np.array([0.0, 15.0, 7.0]), 3, 2) == [' █ ', '▁██']
    assert bars(np.array([2.0, 2.0]), 2) == bars(np.array([-np.inf, np.nan]), 2) == ['▁▁']
    assert bars(np.array([0.0, 7.0]), 4) == ['▁▁██']
    assert bars(np.arange(8.0), 4) == ['▁▃▆█']


def test_a_line_on_a_terminal_stays_one_line(monkeypatch):
    screen = become_terminal(monkeypatch, 80)
    line = StatusLine()
    line.show('x' * 200)
    line.show('done', last=True)
    assert screen.getvalue() == '\r\x1b[K' + 'x' * 79 + '\r\r\x1b[Kdone\n'


@pytest.mark.parametrize(('text', 'width', 'shown'), [
    ('3 of 9 runs done, 2 running; episodes 1.0/s', 30, '3 of 9 runs done, 2 running'),
    ('3 of 9 runs done, 2 running; episodes 1.0/s', 27, '3 of 9 runs done, 2 running'),
    ('3 of 9 runs done, 2 running', 26, '3 of 9 runs done'),
    ('10/40 episodes  1.0/s  best 0.50', 31, '10/40 episodes  1.0/s'),
    ('ten of forty episodes', 11, 'ten of'), ('word', 3, 'wor'), ('word', 4, 'word'),
])
def test_a_line_is_cut_between_its_parts(text, width, shown):
    assert fit(text, width) == shown


def test_messages_of_other_processes_begin_a_line_and_own_ones_remove_the_progress(monkeypatch):
    screen = become_terminal(monkeypatch, 80)
    line = StatusLine()
    line.show('0.0 of 30 s')
    assert screen.getvalue().endswith('0.0 of 30 s\r')
    line.clear()
    assert screen.getvalue().endswith('\r\x1b[K')


def test_progress_that_nobody_can_read_stops_no_command(monkeypatch):
    with open('/dev/full', 'w') as full:
        monkeypatch.setattr('sys.stderr', full)
        StatusLine().show('done', last=True)
        monkeypatch.undo()
        os.dup2(os.open(os.devnull, os.O_WRONLY), full.fileno())  # its buffer is written at its end


def test_evolution_on_a_terminal(monkeypatch):
    screen = become_terminal(monkeypatch, 130)
    line = ProgressLine(total=40, done=0, task=TASKS['walk'])
    line(progress((0.5, 0.1, -0.2)))
    line(progress((0.5, 0.1, -0.2), (0.4, 0.2, -np.inf), (2.0, 0.3, 0.0)))
    first, second = screen.getvalue().split('\r\x1b[K')[1:]
    assert first.startswith(f'{"▁" * 10:·<40}  25 %  ')
    assert second.startswith(f'{"▁" * 22 + "█" * 8:·<40}  75 %  ')
    assert ' left  best 2.00  median 0.30 (0.00…2.00) m/s' in second
    assert max(len(first), len(second)) < 130


def test_a_narrow_terminal_has_no_bar(monkeypatch):
    screen = become_terminal(monkeypatch, 60)
    ProgressLine(total=40, done=0, task=TASKS['walk'])(progress((0.5, 0.1, -0.2)))
    assert screen.getvalue().startswith('\r\x1b[K10/40 episodes  ')


def test_evolution_is_quiet_where_there_is_no_terminal(capsys):
    line = ProgressLine(total=30, done=0, task=TASKS['walk'])
    rows = [(0.5, 0.1, -0.2), (0.4, 0.2, 0.0), (2.0, 0.3, 0.0)]
    line(progress(*rows[:1]))
    line(progress(*rows[:2]))
    assert capsys.readouterr().err == ''  # nothing within a minute
    line(progress(*rows))
    output = capsys.readouterr().err
    assert output.startswith('30/30 episodes  ')
    assert output.endswith('best 2.00  median 0.30 (0.00…2.00) m/s\n')
    assert '\x1b' not in output
