"""A voxel uses no old, foreign or repeated message, and waits as its options say."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule
from support.voxel_world import NoSimulations

from sim_node.control_time import START_STEPS
from sim_node.errors import InvalidInput
from snca_ros.cell.architecture import Architecture
from snca_ros.nodes.own_cell import LocalCell
from snca_ros.nodes.own_part import OwnPart
from snca_ros.nodes.voxel_core import POLL_PERIOD, SensorsResult, VoxelCore

LEFT, RIGHT = 1, 3
HORIZON = 100
ROOM = 16  # messages of other episodes that are kept, at least
EPISODES = [b'r000000%x' % n for n in range(5)]
NOTHING = np.zeros(4)

episodes = st.sampled_from([None] * 12 + EPISODES)  # None: the present one
directions = st.sampled_from([LEFT, RIGHT])


class CellSpy:
    """A cell that records its inputs."""

    def __init__(self):
        self.resets, self.inputs, self.outbox = 0, [], np.zeros((1, 1, 1, 1))

    def reset(self):
        self.resets += 1

    def step_cell(self, i, readings, inbox, step):
        assert i == 0
        self.inputs.append((step, readings.copy(), inbox[:, 0, 0].copy()))
        return 0.5


class NoFaults:
    """The faults of a voxel without any."""

    def __init__(self):
        self.resets = 0

    def reset(self):
        self.resets += 1

    def hear(self, step, inbox):
        return inbox

    def dead(self, step):
        return False


def make_core(patience=0.0, real_time=False, joined=True, faults=None, simulations=None):
    architecture, cells = Architecture.named('U-nD', 'mlp', n_c=1), CellSpy()
    part = OwnPart(architecture, LocalCell(cells), faults or NoFaults(), 'reference')
    core = VoxelCore(
        part, [LEFT, RIGHT], patience=patience, real_time=real_time, horizon=HORIZON,
        simulations=simulations or NoSimulations(),
    )
    core.joined = joined
    return core, cells


def numbered_message(number):
    """Return a message that can be recognised by its number."""
    return np.full((1, 1, 1), float(number))


def sense(core, step, episode=EPISODES[0], now=0.0):
    return core.receive_sensors(episode, step, NOTHING, now)


def send(core, step, *where, episode=EPISODES[0], number=1):
    message = numbered_message(number)
    return [core.receive_message(d, episode, step, message) for d in where or (LEFT, RIGHT)]


class AnythingArrives(RuleBasedStateMachine):
    """Sensors and messages of any episode and step, in any order, any number of times."""

    real_time = False

    def __init__(self):
        super().__init__()
        self.faults = NoFaults()
        self.core, self.cell = make_core(
            real_time=self.real_time, joined=False, faults=self.faults
        )
        self.now, self.number = 0.0, 0
        self.kept = {}  # (direction, episode, step): numbers of what was not refused, in order
        self.n_strays = 0  # messages of other episodes than the present
        self.begun = []  # episodes in the order in which they began
        self.sensed = {}  # (episode, step): readings
        self.answered = []

    def now_or(self, episode):
        return episode or (self.begun[-1] if self.begun else EPISODES[0])

    @rule(episode=episodes, ahead=st.sampled_from([1] * 6 + [2, 3, 0, -1, -7, 100, 101]))
    def sensors(self, episode, ahead):
        episode, step = self.now_or(episode), max(self.core.step + ahead, 0)
        self.number += 1
        readings, before = np.full(4, float(self.number)), self.core.step
        present = bool(self.begun) and episode == self.begun[-1]
        if present and step > before + HORIZON:
            with pytest.raises(InvalidInput, match='stamp'):
                self.core.receive_sensors(episode, step, readings, self.now)
            return
        heard = self.core.receive_sensors(episode, step, readings, self.now)
        if episode in self.begun[:-1]:
            assert heard is SensorsResult.PAST
        elif present and step <= before:
            assert heard is SensorsResult.REPEATED
        else:
            assert heard is SensorsResult.ACCEPTED
            if not present:
                self.begun.append(episode)
            self.sensed[episode, step] = readings
            self.look()

    @precondition(lambda self: self.core.unanswered and not self.core.joined)
    @rule(doubled=st.booleans())
    def join(self, doubled):
        if self.real_time:
            self.core.note_published(self.core.episode, self.core.step)
        assert self.core.join(lambda episode: doubled) == (not doubled)
        assert self.core.held_back == doubled
        self.look()

    @precondition(lambda self: self.core.joined)
    @rule(direction=directions, episode=episodes, ahead=st.sampled_from([0] * 4 + [-1, -2, 1, 3]))
    def message(self, direction, episode, ahead):
        episode, step = self.now_or(episode), max(self.core.step + ahead, 0)
        self.number += 1
        self.n_strays += episode != self.core.episode
        message = numbered_message(self.number)
        if self.core.receive_message(direction, episode, step, message):
            assert episode not in self.begun[:-1]
            assert episode != self.core.episode or step >= self.core.step - 1
            self.kept.setdefault((direction, episode, step), []).append(self.number)
        self.look()

    @rule(seconds=st.floats(0.0, 10.0))
    def time_passes(self, seconds):
        self.now += seconds
        self.look()

    def look(self):
        awaited, may = self.core.awaited, self.core.joined and self.core.unanswered
        answer = self.core.answer(self.now)
        if self.real_time and may and self.core.step >= START_STEPS:
            assert answer, 'waited in real time'
        assert bool(answer) == (may and not awaited)
        if answer is None:
            return
        episode, step = answer.episode, answer.step
        assert episode == self.begun[-1]
        self.answered.append((episode, step))
        cell_step, readings, inbox = self.cell.inputs[-1]
        assert cell_step == step
        assert (readings == self.sensed[episode, step]).all()
        for d, used in enumerate(inbox):
            kept = self.kept.get((d, episode, step - 1), [0.0])
            if self.n_strays <= ROOM:
                assert used == kept[0], 'not the first message'
            else:  # it may have been pushed out before its episode began
                assert used in (0.0, *kept)

    @invariant()
    def no_step_is_made_twice_or_back(self):
        assert len(set(self.answered)) == len(self.answered) == len(self.cell.inputs)
        for episode in self.begun:
            steps = [s for e, s in self.answered if e == episode]
            assert steps == sorted(steps)
        order = [self.begun.index(e) for e, _ in self.answered]
        assert order == sorted(order)

    @invariant()
    def cell_and_faults_are_reset_once_per_episode(self):
        assert self.cell.resets == self.faults.resets == 1 + len(self.begun)

    @invariant()
    def delivery_counts_add_up(self):
        counted = [sum(link.counts().values()) for link in self.core.deliveries.values()]
        assert counted == [sum(step > 0 for _, step in self.answered)] * 2


class AnythingArrivesInRealTime(AnythingArrives):
    """The same in real time, without waiting."""

    real_time = True


TestAnythingArrives = AnythingArrives.TestCase
TestAnythingArrivesInRealTime = AnythingArrivesInRealTime.TestCase
TestAnythingArrives.settings = settings(max_examples=80, stateful_step_count=40)
TestAnythingArrivesInRealTime.settings = TestAnythingArrives.settings


def test_waits_for_every_neighbour_and_only_for_the_step_before():
    core, cell = make_core()
    sense(core, 0)
    assert core.answer(0.0).step == 0
    sense(core, 1)
    send(core, 0, LEFT)
    assert core.awaited == [RIGHT]
    assert core.answer(1e6) is None
    assert send(core, 0, LEFT, number=2) == [False]
    send(core, 0, RIGHT, number=3)
    assert core.answer(1e6).step == 1
    assert cell.inputs[-1][2].tolist() == [0.0, 1.0, 0.0, 3.0]
    assert core.answer(1e6) is None


def test_with_patience_a_neighbour_is_silent_until_its_next_message():
    core, _ = make_core(patience=2.0)
    sense(core, 0)
    assert core.answer(0.0).step == 0
    sense(core, 1)
    assert core.answer(19.9) is None, 'in the first steps it waits ten times as long'
    assert core.answer(20.0).newly_silent == (LEFT, RIGHT)
    for k in (2, 3):
        sense(core, k)
        assert core.answer(0.0).newly_silent == (), 'the silent are not waited for'
    send(core, 3, LEFT)
    sense(core, 4)
    assert core.answer(0.0).newly_silent == ()
    sense(core, 5, now=11.0)
    assert core.answer(12.9) is None
    assert core.awaited == [LEFT]
    assert core.answer(13.0).newly_silent == (LEFT,)


@pytest.mark.parametrize(('step', 'patience'), [
    (START_STEPS - 1, 20.0), (START_STEPS, 2.0), (START_STEPS + 1, 2.0),
])
def test_patience_is_longer_where_the_simulation_waits_longer(step, patience):
    core, _ = make_core(patience=2.0)
    for k in range(step):
        sense(core, k)
        if k:
            send(core, k - 1)
        assert core.answer(0.0).step == k
    sense(core, step)
    send(core, step - 1, RIGHT)
    assert core.answer(patience - 0.1) is None
    assert core.answer(patience).newly_silent == (LEFT,)


def test_a_neighbour_that_has_sent_a_later_message_is_not_awaited():
    core, cell = make_core()
    sense(core, 5)
    assert core.awaited == [LEFT, RIGHT]
    send(core, 5)
    assert core.answer(0.0).step == 5
    assert not cell.inputs[-1][2].any()


def test_real_time_waits_at_the_start_only():
    core, _ = make_core(real_time=True)
    for step in range(20):
        sense(core, step)
        if 1 <= step < START_STEPS:
            assert core.answer(1e6) is None
            send(core, step - 1)
        assert core.answer(0.0).step == step
    assert core.deliveries[LEFT].counts() == {'on time': 1, 'late': 0, 'lost': 18}
    assert core.overdue == [LEFT, RIGHT]
    assert send(core, 10) == [False, False]
    assert core.deliveries[LEFT].counts() == {'on time': 1, 'late': 1, 'lost': 17}


def test_early_messages_of_a_new_episode_are_used():
    core, cell = make_core()
    sense(core, 700)
    send(core, 0, episode=EPISODES[1], number=9)
    assert sense(core, 0, EPISODES[1]) is SensorsResult.ACCEPTED
    assert core.answer(0.0)[:2] == (EPISODES[1], 0)
    assert sense(core, 701, EPISODES[0]) is SensorsResult.PAST
    sense(core, 1, EPISODES[1])
    assert core.answer(0.0).step == 1
    assert cell.inputs[-1][2].tolist() == [0.0, 9.0, 0.0, 9.0]


def test_a_silent_neighbour_is_awaited_again_in_a_new_episode():
    core, _ = make_core(patience=1.0)
    sense(core, 9)
    assert core.answer(1.0).newly_silent == (LEFT, RIGHT)
    sense(core, 0, EPISODES[1])
    assert core.answer(1.0).step == 0
    sense(core, 1, EPISODES[1], now=1.0)
    assert core.awaited == [LEFT, RIGHT]
    assert core.answer(10.9) is None


def test_joins_at_the_newest_step_after_a_pause():
    core, cell = make_core(joined=False)
    assert not core.join(lambda episode: False), 'no sensors yet'
    for step in range(50):
        sense(core, step, now=0.001 * step)
        assert core.joining
        assert core.answer(1.0) is None
    assert core.join(lambda episode: False)
    assert not core.joining
    send(core, 48)
    assert core.answer(1.0).step == 49
    assert len(cell.inputs) == 1


def test_joins_after_a_limit_without_a_pause():
    core, _ = make_core(joined=False)
    waited = []
    for step in range(30):
        sense(core, step, now=50.0 + step / 64)
        waited.append(core.joining)
    assert waited == [True] * 13 + [False] * 17, 'after 0.2 s'


def test_in_real_time_a_late_joiner_answers_no_sensors_of_steps_that_are_over():
    core, cell = make_core(joined=False, real_time=True)
    step, now = 300, 0.0
    while now < 2.0:  # what the simulation has published before, however long it takes to come
        sense(core, step, now=now)
        assert core.joining
        assert core.needs_newest
        assert not core.join(lambda episode: False)
        step, now = step + 1, now + 0.05
    core.note_published(EPISODES[1], 600)  # of another episode
    assert core.needs_newest
    core.note_published(EPISODES[0], 600)
    for old in range(step, 600):
        sense(core, old, now=now)
        assert not core.join(lambda episode: False)
    sense(core, 600, now=now)
    assert not core.joining
    assert core.join(lambda episode: False)
    assert core.answer(now).step == 600
    assert len(cell.inputs) == 1
    sense(core, 601, now=now)
    assert core.answer(now).step == 601


@pytest.mark.parametrize('step', range(START_STEPS))
def test_in_real_time_voxels_join_the_first_steps_without_newer_sensors(step):
    core, _ = make_core(joined=False, real_time=True)
    sense(core, step)
    assert not core.needs_newest
    assert core.join(lambda episode: False)


def test_a_duplicate_is_held_back_until_the_other_node_is_gone():
    core, _ = make_core(joined=False)
    asked = []
    sense(core, 7)
    for active in (True, True, False):
        core.join(lambda episode, active=active: asked.append(episode) or active)
        assert (core.held_back, core.joined) == (active, not active)
    assert asked == [EPISODES[0]] * 3


@pytest.mark.parametrize('receive', [sense, send])
def test_stamps_far_ahead_are_refused(receive):
    core, _ = make_core()
    sense(core, 3)
    with pytest.raises(InvalidInput, match=f'at most step {3 + HORIZON}'):
        receive(core, 4 + HORIZON)
    receive(core, 3 + HORIZON)


def test_polls_less_often_after_a_while():
    core, _ = make_core()
    sense(core, 1, now=5.0)
    periods = [core.poll_period(5.0 + waited) for waited in (0.0, 0.1, 100.0)]
    assert periods == pytest.approx([POLL_PERIOD, 0.025, 0.05])


class OneSimulation(NoSimulations):
    """A graph with one simulation, that of `EPISODES`."""

    def is_live(self, identity):
        return identity == '0000'


def test_the_simulation_of_the_episode_is_followed_while_it_exists():
    core, cell = make_core(simulations=OneSimulation())
    other = b'rffff000'
    assert sense(core, 5, other) is SensorsResult.ACCEPTED, 'it cannot know better yet'
    assert sense(core, 7) is SensorsResult.ACCEPTED
    assert sense(core, 6, other) is SensorsResult.FOREIGN
    assert not core.follow_other_simulation(0.0)
    assert (core.episode, core.step, cell.resets) == (EPISODES[0], 7, 3)
    assert sense(core, 0, EPISODES[1]) is SensorsResult.ACCEPTED, 'a reset'


def test_the_next_simulation_is_followed_when_the_first_is_gone():
    core, _ = make_core()
    live = {'0000', 'ffff'}
    core.episodes._simulations = SimpleNamespace(
        is_live=live.__contains__, is_silent=lambda identity: False
    )
    sense(core, 7)
    assert sense(core, 0, b'rffff000') is SensorsResult.FOREIGN
    assert not core.follow_other_simulation(1.0)
    live.remove('0000')
    assert core.follow_other_simulation(2.0)
    assert core.answer(2.0)[:2] == (b'rffff000', 0)


def test_a_silent_neighbour_is_not_awaited_because_of_a_message_of_another_episode():
    core, _ = make_core(patience=1.0)
    sense(core, 9)
    assert core.answer(1.0).newly_silent == (LEFT, RIGHT)
    send(core, 3, episode=b'rffff000')
    sense(core, 10)
    assert core.awaited == []
