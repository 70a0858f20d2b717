"""Delivery statistics of messages, and which actuation of the voxels is applied."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sim_node.ros.actuation_buffer import Answers
from sim_node.ros.delivery import Delivery, delivery_statistics

VOXELS = ('voxel_0_0', 'voxel_1_0')


@given(st.lists(st.tuples(st.booleans(), st.integers(-1, 40)), max_size=40))
def test_every_message_is_on_time_late_or_lost(steps):
    """Each item is a step: whether its message is on time, and which older message arrives then."""
    delivery, in_time, late = Delivery(), set(), set()
    for step, (on_time, old) in enumerate(steps):
        delivery.close_step(step, on_time)
        in_time |= {step} if on_time else set()
        delivery.note_late(old)
        if 0 <= old <= step and old not in in_time:
            late.add(old)
    assert delivery.on_time == len(in_time)
    assert delivery.late == len(late)
    assert delivery.on_time + delivery.late + delivery.lost == len(steps)
    assert delivery.newest == max(in_time, default=-1)


def test_skipped_messages_are_lost():
    delivery = Delivery()
    for step in (7, 8, 11):
        delivery.arrive(step)
    delivery.note_late(10)
    assert delivery.counts() == {'on time': 3, 'late': 1, 'lost': 1}


def test_messages_of_an_earlier_episode_do_not_count_as_late():
    delivery = Delivery()
    delivery.close_step(0, False)
    delivery.restart()
    delivery.note_late(0)
    assert delivery_statistics({'a': delivery}) == {'a on time': 0, 'a late': 0, 'a lost': 1}


def test_actuation_is_held_until_the_voxel_counts_as_silent():
    answers = Answers(VOXELS, hold=True)
    answers.open_step()
    assert answers.take(0, 0, 0.5, step=0, now=0.0)
    assert not answers.complete
    assert answers.take(1, 0, -1.0, step=0, now=0.0)
    assert answers.missing == []
    assert answers.complete
    np.testing.assert_array_equal(answers.close_step(0), [0.5, -1.0])
    np.testing.assert_array_equal(answers.ages(0), [0, 0])
    answers.open_step()
    assert answers.take(0, 1, 0.25, step=1, now=0.2)
    assert answers.missing == ['voxel_1_0']
    assert not answers.complete
    np.testing.assert_array_equal(answers.close_step(1), [0.25, -1.0])
    np.testing.assert_array_equal(answers.ages(1), [0, 1])
    answers.open_step()
    assert not answers.take(1, 1, 0.75, step=2, now=0.25)  # late, but the newest
    np.testing.assert_array_equal(answers.close_step(2), [0.25, 0.75])
    np.testing.assert_array_equal(answers.ages(2), [1, 1])
    assert answers.mark_silent(0.5, 0.25) == ['voxel_0_0']
    assert answers.mark_silent(0.5, 0.25) == []
    answers.open_step()
    np.testing.assert_array_equal(answers.close_step(3), [0.0, 0.75])
    np.testing.assert_array_equal(answers.ages(3), [-1, 2])
    assert answers.silent == {'voxel_0_0'}
    assert not answers.take(0, 1, 0.25, step=4, now=0.6)  # repeated: it stays silent
    assert answers.silent == {'voxel_0_0'}
    answers.open_step()
    assert answers.take(0, 4, 1.0, step=4, now=0.6)
    assert answers.silent == set()
    assert [delivery.late for delivery in answers.deliveries] == [0, 1]


def test_late_actuation_is_not_applied_in_lock_step():
    answers = Answers(VOXELS, hold=False)
    answers.open_step()
    assert not answers.take(0, 0, 0.5, step=1, now=0.0)
    answers.silent.add('voxel_0_0')
    assert answers.missing == ['voxel_1_0']
    assert not answers.complete
    answers.silent.update(VOXELS)
    assert answers.missing == []
    assert answers.complete
    np.testing.assert_array_equal(answers.close_step(1), [0.0, 0.0])
    np.testing.assert_array_equal(answers.ages(1), [-1, -1])
    assert answers.silent == set(VOXELS)
