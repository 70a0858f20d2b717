"""A voxel follows the simulation that it has joined as long as that exists, whatever others say."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snca_ros.nodes.episode_choice import EpisodeChoice, Sensors
from snca_ros.nodes.inbox import MessageBuffer

A0, A1, B0, B1 = b'raaaa000', b'raaaa001', b'rbbbb000', b'rbbbb001'
OLD = b'rcccc000'  # of a bag
IDENTITY = {A0: 'aaaa', A1: 'aaaa', B0: 'bbbb', B1: 'bbbb', OLD: 'cccc'}


class Graph:
    """The simulations that exist; those in `killed` are silent."""

    def __init__(self, *live):
        self.live, self.killed, self.asked = set(live), set(), 0

    def is_live(self, identity):
        self.asked += 1
        return identity in self.live

    def is_silent(self, identity):
        assert identity in self.live, 'asked about a simulation that does not exist'
        return identity in self.killed


def choice_in(graph, *episodes):
    choice = EpisodeChoice(graph)
    for episode in episodes:
        choice.begin(episode)
    return choice


def verdict(choice, episode):
    if choice.is_foreign(episode):
        return 'foreign'
    return 'past' if choice.is_past(episode) else 'begins'


def sensors(episode, step=0, now=0.0):
    return Sensors(episode, step, np.zeros(4), now)


@pytest.mark.parametrize(('live', 'past', 'episode', 'expected'), [
    # The current episode is A0.
    ('aaaa', (), A1, 'begins'),  # a reset
    ('aaaa', (A1,), A1, 'past'),  # a message from before the reset
    ('', (), A1, 'begins'),
    ('', (A1,), A1, 'past'),
    ('aaaa', (), OLD, 'foreign'),  # a bag is played
    ('aaaa', (OLD,), OLD, 'foreign'),
    ('aaaa bbbb', (), B0, 'foreign'),  # a second simulation
    ('aaaa bbbb', (B0,), B0, 'foreign'),
    ('bbbb', (), B0, 'begins'),  # a restarted simulation
    ('bbbb', (B0,), B0, 'begins'),  # which was lost for a while, to a bag
    ('', (), OLD, 'begins'),  # no simulation announces itself
    ('', (OLD,), OLD, 'past'),
    ('bbbb', (), OLD, 'begins'),
    ('aaaa', (), b'x', 'foreign'),
    ('', (), b'x', 'begins'),
])
def test_which_episode_may_follow(live, past, episode, expected):
    graph = Graph(*live.split())
    assert verdict(choice_in(graph, *past, A0), episode) == expected


def test_before_the_first_episode_any_may_begin():
    for live in ((), ('aaaa',), ('bbbb',)):
        assert verdict(EpisodeChoice(Graph(*live)), A0) == 'begins'


def test_a_simulation_in_place_of_one_that_was_killed_is_followed_when_that_is_silent():
    graph = Graph('aaaa', 'bbbb')
    choice = choice_in(graph, A0)
    choice.ignore(sensors(B0))
    assert choice.take_ignored() is None
    graph.killed.add('aaaa')
    assert verdict(choice, OLD) == 'foreign', 'a bag does not replace even that'
    assert verdict(choice, B0) == 'begins'
    assert choice.take_ignored().episode == B0
    assert choice.take_ignored() is None, 'they are used once'


@given(st.permutations([OLD, B0, OLD, OLD]))
def test_sensors_of_a_bag_do_not_displace_those_of_the_next_simulation(order):
    graph = Graph('aaaa', 'bbbb')
    choice = choice_in(graph, A0)
    for episode in order:
        choice.ignore(sensors(episode))
    assert choice.take_ignored() is None
    graph.live.remove('aaaa')
    assert choice.take_ignored().episode == B0


def test_sensors_of_a_bag_are_not_used_when_the_simulation_has_ended():
    graph = Graph('aaaa')
    choice = choice_in(graph, A0)
    choice.ignore(sensors(OLD))
    graph.live.clear()
    assert choice.take_ignored() is None


def test_ignored_sensors_are_shown_for_a_while_or_while_their_simulation_exists():
    graph = Graph('aaaa', 'bbbb')
    choice = choice_in(graph, A0)
    assert not choice.ignores(0.0)
    choice.ignore(sensors(OLD, now=10.0))
    assert choice.ignores(14.9)
    assert not choice.ignores(15.1)
    choice.ignore(sensors(B0, now=20.0))
    assert choice.ignores(1e6)
    graph.live.remove('bbbb')
    assert not choice.ignores(1e6)


def test_the_graph_is_not_asked_about_resets():
    graph = Graph('aaaa')
    choice = choice_in(graph, A0)
    assert verdict(choice, A1) == 'begins'
    assert graph.asked == 0


def test_messages_of_a_bag_do_not_displace_those_of_a_simulation_that_exists():
    buffer = MessageBuffer(lambda episode: episode == B0)
    buffer.advance_to(A0, 500)
    buffer.put(B0, 3, np.array([1]))
    for step in range(3):  # lower steps than the simulation's
        for k in range(20):
            buffer.put(b'rcccc%03x' % k, step, np.array([0]))
    buffer.advance_to(B0, 3)
    assert buffer.pop(3)[0] == 1


def test_messages_of_an_episode_that_begins_again_are_kept():
    buffer = MessageBuffer(lambda episode: True)
    for episode in (A0, OLD, A0):
        buffer.advance_to(episode, 0)
    assert buffer.put(A0, 0, np.array([1]))
