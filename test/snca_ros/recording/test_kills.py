"""Messages that a kill of a voxel has lost, or that were published twice for it."""

import json

import numpy as np
from support.synthetic_bag import diagnostics, make_walk, messages_of_walk, write_messages

from snca_ros.cli import main
from snca_ros.recording.bag import read_bag
from snca_ros.recording.kills import count_kills, lost_by_kills
from snca_ros.recording.outcomes import Outcome

N_STEPS = 30
ACTUATION, SPIKES = '/biped/voxel_1_0/actuation', '/biped/voxel_1_0/spikes'


def count_of(bag, topic):
    (count,) = [count for count in read_bag(bag).counts if count.topic == topic]
    return count


def write_killed(folder, lost, processes):
    """Write a bag that lacks the answers `lost` of a voxel, which the simulation had in time."""
    messages = messages_of_walk(make_walk(N_STEPS, ages=np.zeros((N_STEPS, 2))))
    for k in lost:
        messages[k] = [m for m in messages[k] if m[0] != ACTUATION]
    for i in range(processes):
        status = diagnostics('/biped/voxel_1_0', {'steps': 5}, f'host:{i}')
        messages[5 + i].append(('/diagnostics', status))
    return write_messages(folder, messages)


def test_a_kill_explains_one_step(tmp_path):
    for processes, killed in ((1, []), (2, [7]), (3, [7, 9])):
        bag = write_killed(tmp_path / str(processes), (7, 9), processes)
        count = count_of(bag, ACTUATION)
        assert count.missing.tolist() == [7, 9]
        assert count.killed.tolist() == killed
        assert count_of(bag, SPIKES).killed.tolist() == []


def test_only_what_the_simulation_had_is_explained():
    outcomes = np.full(N_STEPS, Outcome.IN_TIME)
    outcomes[4] = Outcome.HELD
    assert lost_by_kills(np.array([4, 6, 8]), outcomes, 2).tolist() == [6, 8]
    sent = np.ones(N_STEPS, dtype=bool)
    assert count_kills(3, sent) == 2
    sent[20:] = False  # killed and not restarted
    assert count_kills(3, sent) == 3


def test_a_message_with_another_content_is_named(tmp_path, capsys):
    """A restarted voxel repeats the step in which it was killed."""
    walk, other = make_walk(N_STEPS), make_walk(N_STEPS, seed=1)
    messages = messages_of_walk(walk)
    for k in (7, 11):
        messages[k] += [m for m in messages_of_walk(other)[k] if m[0] == SPIKES]
    messages[9] += [m for m in messages[9] if m[0] == SPIKES]  # the same content
    bag = write_messages(tmp_path / 'bag', messages)
    assert count_of(bag, SPIKES).twice.tolist() == [7, 11]
    assert main(['report', str(bag), '--json', str(tmp_path / 'report.json')]) == 0
    assert f'published twice on {SPIKES}: 2 (steps 7, 11)' in capsys.readouterr().out
    topics = json.loads((tmp_path / 'report.json').read_text())['topics']
    assert topics[SPIKES]['published_twice'] == 2
    assert topics[ACTUATION]['lost_by_kill'] == topics[ACTUATION]['published_twice'] == 0
