"""Mistakes in a task from outside: each is reported in one line."""

import numpy as np
import pytest

from sim_node.errors import InvalidInput
from snca_ros.evolution.tasks import TASKS, Episode, Task, score_of


class Unfinished(Task):
    """A task whose attributes a test sets."""

    def score(self, episode, transient):
        return None


@pytest.mark.parametrize(('task', 'message'), [
    (Unfinished, 'an object of a class derived from Task'),
    (Unfinished(), r'unfinished\.quantity: got None, expected a string'),
    (type('NoUnit', (Unfinished,), {'quantity': 'rise'})(), r'unfinished\.unit: got None'),
    (type('Text', (Unfinished,), {'quantity': 'a', 'unit': '', 'records': 'touching'})(),
     r"unfinished\.records: got 'touching', expected a tuple"),
])
def test_a_mistake_is_reported_at_registration(task, message):
    with pytest.raises(InvalidInput, match=message):
        TASKS.register('unfinished', task)
    assert 'unfinished' not in TASKS


@pytest.mark.parametrize('value', [None, 'far', np.zeros(2), float('nan')])
def test_a_score_that_is_no_number_is_refused(value):
    task = type('Odd', (Unfinished,), {'quantity': 'rise', 'score': lambda *arguments: value})()
    with pytest.raises(InvalidInput, match=r'Odd\.score: .*a number, rise of the episode'):
        score_of(task, Episode(np.zeros((2, 2)), diverged=False), 0.0)
