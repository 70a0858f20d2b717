"""What moved the body is published by the simulation, or follows from the order of messages."""

import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from support.synthetic_bag import (
    count_of,
    death,
    diagnostics,
    joint_state,
    make_walk,
    messages_of_walk,
    write_messages,
)

from sim_node.ros.actuation_buffer import Answers
from snca_ros.recording.bag import read_bag
from snca_ros.recording.gait import measure_gait
from snca_ros.recording.outcomes import Outcome, find_outcomes
from snca_ros.recording.report import report_lines
from snca_ros.recording.streams import Stream
from snca_ros.recording.topics import APPLIED, ODOMETRY, Role

N_STEPS, DEAD, BACKLOG, ALIVE = 40, 5, 10, 30
VOXEL = 1


def died(tmp_path, with_applied=True, real_time=True):
    messages = death(N_STEPS, VOXEL, DEAD, BACKLOG, ALIVE)
    figures = {'missed deadlines': 0} if real_time else {}
    messages[-1].append(('/diagnostics', diagnostics('/biped/sim_node', figures)))
    if not with_applied:
        messages = [[m for m in step if 'applied' not in m[0]] for step in messages]
    return read_bag(write_messages(tmp_path / 'bag', messages))


def test_late_messages_do_not_count(tmp_path):
    bag, walk = died(tmp_path), make_walk(N_STEPS)
    steps = np.arange(N_STEPS)
    gone = (steps >= DEAD) & (steps < ALIVE)
    backlog = gone & (steps >= BACKLOG)
    np.testing.assert_array_equal(bag.late[:-1, VOXEL], backlog)
    np.testing.assert_array_equal(bag.heard[:-1, VOXEL], ~gone)
    np.testing.assert_array_equal(bag.spikes[:-1][backlog], walk.spikes[backlog])
    rate = walk.spikes[~gone, VOXEL].sum() / 4 / ((~gone).sum() / 60)
    np.testing.assert_allclose(measure_gait(bag).firing_rates[VOXEL], rate)
    assert bag.heard[:-1, 0].all()


def test_the_simulation_says_what_moved_the_body(tmp_path):
    bag, walk = died(tmp_path), make_walk(N_STEPS)
    steps = np.arange(N_STEPS)
    want = np.full(N_STEPS, Outcome.IN_TIME)
    want[(steps >= DEAD) & (steps < ALIVE)] = Outcome.LIMP
    want[[DEAD, DEAD + 1]] = Outcome.HELD
    np.testing.assert_array_equal(bag.outcomes[:-1, VOXEL], want)
    np.testing.assert_array_equal(bag.applied[:-1, 0], walk.actuation[:, 0])
    assert (bag.applied[DEAD : DEAD + 2, VOXEL] == walk.actuation[DEAD - 1, VOXEL]).all()
    assert not bag.applied[DEAD + 2 : ALIVE, VOXEL].any()
    assert (bag.outcomes[-1] == Outcome.UNKNOWN).all()
    assert np.isnan(bag.applied[-1]).all()


def test_old_bags_in_real_time_tell_late_answers_by_their_order(tmp_path):
    """The synthetic bag has 500 steps per second: 125 steps until a voxel would be limp."""
    bag, walk = died(tmp_path, with_applied=False), make_walk(N_STEPS)
    gone = slice(DEAD, ALIVE)
    assert (bag.outcomes[gone, VOXEL] == Outcome.HELD).all()
    assert (bag.applied[gone, VOXEL] == walk.actuation[DEAD - 1, VOXEL]).all()
    np.testing.assert_array_equal(bag.applied[ALIVE:-1], walk.actuation[ALIVE:])
    assert bag.late[BACKLOG:ALIVE, VOXEL].all()
    (count,) = [c for c in bag.counts if c.topic.endswith('1_0/actuation')]
    assert (count.lost, count.unsent.tolist()) == (0, [*range(DEAD, BACKLOG)])


def test_old_bags_in_lock_step_do_not_know_what_was_lost(tmp_path):
    bag = died(tmp_path, with_applied=False, real_time=False)
    assert (bag.outcomes[DEAD:BACKLOG, VOXEL] == Outcome.UNKNOWN).all()
    assert np.isnan(bag.applied[DEAD:BACKLOG, VOXEL]).all()
    (count,) = [c for c in bag.counts if c.topic.endswith('1_0/actuation')]
    assert (count.lost, len(count.unsent)) == (BACKLOG - DEAD, 0)


def test_broken_actuators_move_the_body_in_time(tmp_path):
    walk = replace(make_walk(N_STEPS), ages=np.zeros((N_STEPS, 2)), applied=np.zeros((N_STEPS, 2)))
    bag = read_bag(write_messages(tmp_path / 'bag', messages_of_walk(walk)))
    assert (bag.outcomes[:-1] == Outcome.IN_TIME).all()
    assert not bag.applied[:-1].any()
    assert bag.actuation[:-1].all()


def test_impossible_ages_and_actuation_are_refused(tmp_path):
    walk = replace(make_walk(9), ages=np.zeros((9, 2)))
    messages = messages_of_walk(walk)
    for applied, ages in (([0.0, 2.0], [0, 0]), ([0.0, 0.0], [0, -2]), ([0.0, 0.0], [0.5, 0]),
                          ([0.0, 0.0], [0])):
        strange = joint_state(3, 'biped@r5f0c17e', walk.voxels, np.array(applied), ages)
        messages[2].append(('/biped/applied_actuation', strange))
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    np.testing.assert_array_equal(bag.applied[:-1], walk.actuation)
    assert {c.topic: c.refused for c in bag.counts if c.refused} == {'/biped/applied_actuation': 4}


def a_stream(steps, order, numbers, fields=()):
    none = np.zeros(len(steps), int)
    return Stream(
        np.array(steps, int), np.array(order, int), none, np.array(numbers),
        none.astype('S'), fields=fields,
    )


@given(st.lists(st.integers(0, 6) | st.none(), min_size=12, max_size=12))
def test_the_order_of_messages_tells_what_the_simulation_says(delays):
    """Answer k arrives `delays[k]` steps late, or never; the simulation does not wait."""
    n, limit, rng = 12, 4, np.random.default_rng(0)
    values, answers = rng.uniform(-1, 1, n), Answers(['voxel_0_0'], hold=True)
    answers.restart(0.0)
    odometry_order, answer_order, place = [], {}, 0
    applied, ages = np.empty(n), np.empty(n)
    for k in range(n):
        odometry_order.append(place)
        place += 1
        answers.open_step()
        for j in range(k + 1):
            if delays[j] is not None and j + delays[j] == k:
                answers.take(0, j, values[j], k, float(k))
                answer_order[j] = place
                place += 1
        answers.mark_silent(float(k), limit)
        applied[k], ages[k] = answers.close_step(k)[0], answers.ages(k)[0]
    odometry_order.append(place)
    known = sorted(answer_order, key=lambda j: answer_order[j])
    kept = sorted(known)
    streams = {
        ODOMETRY: a_stream(range(n + 1), odometry_order, np.zeros((n + 1, 2))),
        Role('actuation', 'voxel_0_0'): a_stream(
            kept, [answer_order[j] for j in kept], values[kept].reshape(-1, 1)
        ),
    }
    found = find_outcomes(streams, ('voxel_0_0',), n + 1, False, limit / 0.25)
    streams[APPLIED] = a_stream(
        range(n), range(n), np.stack([applied, ages], axis=1)[:, None], ('voxel_0_0',)
    )
    inferred = find_outcomes(streams, ('voxel_0_0',), n + 1, False, limit / 0.25)
    np.testing.assert_array_equal(inferred.applied[:-1, 0], applied)
    # A voxel that has never answered counts as silent from its start, and as limp here.
    np.testing.assert_array_equal(found.outcomes, inferred.outcomes)
    np.testing.assert_array_equal(found.applied, inferred.applied)
    np.testing.assert_array_equal(found.late['actuation'], inferred.late['actuation'])


LOSSY = {'missed deadlines': 0, 'best-effort links': 2}
HEARD, UNHEARD, UNRECORDED, LOST, LATE, UNSENT, TOO_LATE = range(7)


@settings(max_examples=20, deadline=None)
@given(st.lists(st.integers(HEARD, TOO_LATE), min_size=9, max_size=30))
def test_best_effort_links_lose_answers_to_the_simulation_or_to_the_recorder(fates):
    """Spikes of a step are recorded, unless nothing was sent.

    An answer can be late for the simulation alone, which then counts fewer as lost.
    """
    n, walk = len(fates), make_walk(len(fates))
    fates = np.array(fates)
    fates[-1] = HEARD  # the last late answer is recorded before the walk ends
    ages = np.zeros((n, 2))
    ages[~np.isin(fates, (HEARD, UNRECORDED)), VOXEL] = -1.0
    messages = messages_of_walk(replace(walk, ages=ages))
    topic = '/biped/voxel_1_0/actuation'
    for k in range(n - 1, -1, -1):  # so that late answers are not taken for those of the step
        answers = [m for m in messages[k] if m[0] == topic]
        if fates[k] in (UNRECORDED, LOST, LATE):
            messages[k] = [m for m in messages[k] if m[0] != topic]
        if fates[k] == LATE:
            messages[k + 1] += answers
        if fates[k] == UNSENT:
            messages[k] = [m for m in messages[k] if 'voxel_1_0' not in m[0] or 'sensors' in m[0]]
    lost = {'voxel_1_0/actuation lost': int(np.isin(fates, (UNHEARD, LOST, UNSENT)).sum())}
    messages[-1].append(('/diagnostics', diagnostics('/biped/sim_node', {**LOSSY, **lost})))
    with tempfile.TemporaryDirectory() as folder:
        bag = read_bag(write_messages(Path(folder, 'bag'), messages))
    count = count_of(bag, topic)
    number = [int((fates == fate).sum()) for fate in range(7)]
    assert count.in_time == number[HEARD] + number[UNRECORDED]
    assert count.lost == number[UNHEARD] + number[LOST]
    assert len(count.late) == number[LATE] + number[TOO_LATE]
    assert len(count.unsent) == number[UNSENT]
    assert count.sent == n - number[UNSENT]
    assert len(count.unrecorded) == number[UNRECORDED]
    assert not len(count.killed)
    assert count_of(bag, '/biped/voxel_0_0/actuation').in_time == n
    text = '\n'.join(report_lines(bag, measure_gait(bag)))
    assert (f'lost on {topic}: {count.lost} (steps' in text) == bool(count.lost)
