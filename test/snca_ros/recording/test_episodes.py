"""Episodes are those of the simulation, whatever clocks and strangers do."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.synthetic_bag import (
    STEP_TIME,
    clock,
    joint_state,
    make_walk,
    messages_of_walk,
    odometry,
    write_messages,
)

from snca_ros.recording.bag import read_bag
from snca_ros.recording.episodes import _nearest
from snca_ros.recording.outcomes import Outcome
from snca_ros.recording.streams import Stream

N_STEPS, SET_BACK = 480, 146


def whole_walk(**changes):
    walk = make_walk(N_STEPS)
    corners = np.random.default_rng(0).normal(size=(N_STEPS + 1, 2, 4, 2))
    ground = np.array([[0.0, 5.0], [20.0, 5.0]])
    return replace(walk, corners=corners, ground=ground, **changes)


def set_back(k):
    return -30 * 10**9 if k >= SET_BACK else 0


def in_order_of_time(messages):
    """Return the messages of a walk as a tool writes them that sorts by the recorder's clock."""
    order = sorted(range(len(messages)), key=lambda k: k * STEP_TIME + set_back(k))
    return [messages[k] for k in order]


@pytest.mark.parametrize('storage', ['mcap', 'sqlite3'])
@pytest.mark.parametrize('walk', [
    whole_walk(), whole_walk(episode=''), whole_walk(ages=np.zeros((N_STEPS, 2))),
], ids=['without applied actuation', 'without names', 'new'])
def test_a_clock_that_is_set_back_changes_nothing(tmp_path, storage, walk):
    bag = read_bag(write_messages(
        tmp_path / 'bag', messages_of_walk(walk), storage, clock_error=set_back
    ))
    assert_is_whole(bag, walk)
    assert bag.rate == pytest.approx(500.0, rel=1e-2)
    assert not bag.late.any()
    assert (bag.outcomes[:-1] == Outcome.IN_TIME).all()
    np.testing.assert_array_equal(bag.applied[:-1], walk.actuation)


def assert_is_whole(bag, walk):
    assert (bag.n_episodes, bag.n_steps) == (1, N_STEPS + 1)
    assert sum(count.lost + len(count.unsent) + count.refused for count in bag.counts) == 0
    np.testing.assert_array_equal(bag.centers, walk.centers)
    np.testing.assert_array_equal(bag.actuation[:-1], walk.actuation)
    np.testing.assert_array_equal(bag.poses.corners, walk.corners[bag.poses.steps])
    assert len(bag.poses.steps) == N_STEPS // 2 + 1


def test_a_bag_that_was_sorted_by_a_clock_set_back_is_whole_by_the_names_of_episodes(tmp_path):
    walk = whole_walk(ages=np.zeros((N_STEPS, 2)))
    messages = messages_of_walk(walk)
    assert_is_whole(read_bag(write_messages(tmp_path / 'bag', in_order_of_time(messages))), walk)


@settings(max_examples=20)
@given(st.lists(st.booleans(), min_size=12, max_size=12))
def test_episodes_that_are_mixed_are_separated_by_their_names(tmp_path_factory, turns):
    """An old bag is played into a running robot: its messages are on the same topics."""
    walks = [
        replace(make_walk(5, seed=i), episode=name, ages=np.zeros((5, 2)))
        for i, name in enumerate(['r5f0c17e', 'r0000001'])
    ]
    left = [messages_of_walk(walk) for walk in walks]
    first = int(not turns[0])
    mixed = []
    for turn in turns:
        mixed += [left[not turn].pop(0)] if left[not turn] else []
    mixed += left[0] + left[1]
    bag = write_messages(tmp_path_factory.mktemp('mixed') / 'bag', mixed)
    for episode, walk in enumerate([walks[first], walks[1 - first]]):
        found = read_bag(bag, episode)
        assert found.n_episodes == 2
        np.testing.assert_array_equal(found.readings[:-1], walk.readings)
        np.testing.assert_array_equal(found.spikes[:-1], walk.spikes)
        np.testing.assert_array_equal(found.applied[:-1], walk.actuation)
        np.testing.assert_array_equal(found.centers, walk.centers)


def test_strangers_forge_no_episode(tmp_path):
    walk = replace(make_walk(30), ages=np.zeros((30, 2)))
    messages = messages_of_walk(walk)
    forged = joint_state(12, 'voxel_0_0@r0000000', walk.sensors, np.zeros(4))
    messages[12].insert(2, ('/biped/voxel_0_0/sensors', forged))
    messages[14].append(('/biped/odometry', odometry(10**7, np.zeros(2))))
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    assert (bag.n_episodes, bag.n_steps) == (1, 31)
    np.testing.assert_array_equal(bag.readings[:-1], walk.readings)
    np.testing.assert_array_equal(bag.centers, walk.centers)
    refused = {count.topic: count.refused for count in bag.counts if count.refused}
    assert refused == {'/biped/odometry': 1, '/biped/voxel_0_0/sensors': 1}


def test_of_two_robots_on_the_clock_only_the_own_one_counts(tmp_path):
    walk = make_walk(30)
    messages = messages_of_walk(walk)
    for k, step in enumerate(messages):
        step.append(('/clock', clock((k + 17) % 31)))
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    assert (bag.n_episodes, bag.n_steps) == (1, 31)
    (count,) = [count for count in bag.counts if count.topic == '/clock']
    assert (count.received, count.lost) == (31, 0)


PLACES = st.lists(st.integers(0, 4), max_size=8)


def stream(steps, order):
    none = np.zeros(len(steps))
    return Stream(np.array(steps, int), np.array(order, int), none, none, none.astype('S'))


@given(PLACES, PLACES, st.randoms(use_true_random=False), st.integers(0, 1))
def test_the_nearest_message_of_the_same_step_is_found(among, of, random, back):
    orders = random.sample(range(20), len(among) + len(of))
    a = stream(among, sorted(orders[: len(among)]))
    b = stream(of, sorted(orders[len(among) :]))
    for i, found in enumerate(_nearest(a, b, back)):
        distances = [
            abs(order - b.order[i]) for step, order in zip(a.steps, a.order, strict=True)
            if step == b.steps[i] - back and (order < b.order[i] or not back)
        ]
        assert (found >= 0) == bool(distances)
        if distances:
            assert a.steps[found] == b.steps[i] - back
            assert abs(a.order[found] - b.order[i]) == min(distances)
