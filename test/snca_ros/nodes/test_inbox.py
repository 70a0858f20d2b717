"""The buffer of a neighbour's messages: it keeps the first one per step, whatever else arrives."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from snca_ros.nodes.inbox import MessageBuffer

NOW = b'episode1'
EPISODES = st.sampled_from([NOW, b'episode2', b'episode3']) | st.binary(min_size=8, max_size=8)


def message_of(n):
    return np.array([n])


@given(st.lists(st.tuples(EPISODES, st.integers(0, 40)), max_size=200))
def test_the_first_message_for_a_step_is_kept_whatever_arrives(flood):
    buffer = MessageBuffer(lambda episode: False)
    buffer.advance_to(NOW, 10)
    first = {}
    for n, (episode, step) in enumerate(flood):
        fresh = (episode, step) not in first and not (episode == NOW and step < 10)
        kept = buffer.put(episode, step, message_of(n))
        if episode == NOW:
            assert kept == fresh
        if fresh:
            first[episode, step] = n
    for step in range(10, 41):
        assert (step in buffer) == ((NOW, step) in first)
        message = buffer.pop(step)
        assert (None if message is None else message[0]) == first.get((NOW, step))
        assert step not in buffer


@given(st.lists(st.binary(min_size=8, max_size=8), max_size=50))
def test_few_messages_of_other_episodes_are_kept(episodes):
    buffer = MessageBuffer(lambda episode: False)
    buffer.advance_to(NOW, 0)
    for episode in episodes:
        buffer.put(episode, 7, message_of(0))
    assert len(buffer._messages) <= 16


def test_early_messages_of_the_next_episode_are_kept_until_it_begins():
    buffer = MessageBuffer(lambda episode: False)
    buffer.advance_to(NOW, 500)
    buffer.put(NOW, 501, message_of(1))
    buffer.put(b'episode2', 0, message_of(2))
    buffer.advance_to(b'episode2', 0)
    assert 501 not in buffer
    assert buffer.pop(0)[0] == 2
    assert not buffer.put(NOW, 502, message_of(3))


def test_messages_for_past_steps_are_dropped():
    buffer = MessageBuffer(lambda episode: False)
    buffer.advance_to(NOW, 0)
    for step in range(5):
        buffer.put(NOW, step, message_of(step))
    buffer.advance_to(NOW, 4)
    assert 3 not in buffer
    assert 4 in buffer
    assert not buffer.put(NOW, 3, message_of(3))


def test_the_first_steps_of_another_episode_are_kept_when_the_buffer_is_full():
    buffer = MessageBuffer(lambda episode: False)
    buffer.advance_to(NOW, 500)
    for step in range(40):
        buffer.put(b'episode2', step, message_of(step))
    buffer.advance_to(b'episode2', 0)
    assert buffer.pop(0)[0] == 0
    assert 39 not in buffer
