"""Messages that wait to be used: the first word counts, and no flood pushes out what is needed."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from snca_ros.nodes.inbox import Pending

NOW = b'episode1'
EPISODES = st.sampled_from([NOW, b'episode2', b'episode3']) | st.binary(min_size=8, max_size=8)


def word(n):
    return np.array([n])


@given(st.lists(st.tuples(EPISODES, st.integers(0, 40)), max_size=200))
def test_first_word_about_a_step_to_come_is_kept_whatever_comes(flood):
    pending = Pending()
    pending.turn_to(NOW, 10)
    first = {}
    for n, (episode, step) in enumerate(flood):
        fresh = (episode, step) not in first and not (episode == NOW and step < 10)
        kept = pending.put(episode, step, word(n))
        if episode == NOW:
            assert kept == fresh
        if fresh:
            first[episode, step] = n
    for step in range(10, 41):
        assert (step in pending) == ((NOW, step) in first)
        message = pending.pop(step)
        assert (None if message is None else message[0]) == first.get((NOW, step))
        assert step not in pending


@given(st.lists(st.binary(min_size=8, max_size=8), max_size=50))
def test_room_for_other_episodes_is_small(episodes):
    pending = Pending()
    pending.turn_to(NOW, 0)
    for episode in episodes:
        pending.put(episode, 7, word(0))
    assert len(pending._messages) <= 16


def test_what_was_said_of_the_next_episode_is_there_when_it_begins():
    pending = Pending()
    pending.turn_to(NOW, 500)
    pending.put(NOW, 501, word(1))
    pending.put(b'episode2', 0, word(2))
    pending.turn_to(b'episode2', 0)
    assert 501 not in pending
    assert pending.pop(0)[0] == 2
    assert not pending.put(NOW, 502, word(3))


def test_steps_that_are_over_are_forgotten():
    pending = Pending()
    pending.turn_to(NOW, 0)
    for step in range(5):
        pending.put(NOW, step, word(step))
    pending.turn_to(NOW, 4)
    assert 3 not in pending
    assert 4 in pending
    assert not pending.put(NOW, 3, word(3))


def test_beginning_of_another_episode_is_kept_when_there_is_no_room():
    pending = Pending()
    pending.turn_to(NOW, 500)
    for step in range(40):
        pending.put(b'episode2', step, word(step))
    pending.turn_to(b'episode2', 0)
    assert pending.pop(0)[0] == 0
    assert 39 not in pending
