"""Bags are read as the numbers that were recorded, or refused in one line."""

import contextlib
import itertools
import shutil
import struct
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support import synthetic_bag
from support.limits import LIMIT
from support.synthetic_bag import (
    STORAGES,
    TYPES,
    Walk,
    clock,
    diagnostics,
    image,
    joint_state,
    make_walk,
    messages_of_step,
    messages_of_walk,
    odometry,
    write_messages,
)

from sim_node.control_time import stamp_of_step, step_of_stamp
from sim_node.errors import InvalidInput
from snca_ros.recording.bag import Recording, read_bag

N_STEPS = 12
NUMBERED = [
    topic for topic, _ in messages_of_step(make_walk(2), 1) if not topic.endswith('markers')
]


@pytest.fixture(scope='module')
def whole(tmp_path_factory):
    """An intact MCAP bag of the walk `make_walk(N_STEPS)`."""
    return write_messages(
        tmp_path_factory.mktemp('whole') / 'bag', messages_of_walk(make_walk(N_STEPS))
    )


def without(messages, lost):
    """Leave out the messages that `lost`, a set of (topic, step), names."""
    return [
        [message for message in step if (message[0], k) not in lost]
        for k, step in enumerate(messages)
    ]


def count_of(recording: Recording, topic: str):
    return next(c for c in recording.counts if c.topic == topic)


@given(st.integers(0, 10**7))
def test_stamps_and_steps_are_each_others_inverse(step):
    assert step_of_stamp(*stamp_of_step(step)) == step


@pytest.mark.parametrize('storage', STORAGES)
def test_every_number_is_read(tmp_path, storage):
    walk = make_walk(N_STEPS)
    bag = read_bag(write_messages(tmp_path / 'bag', messages_of_walk(walk), storage))
    assert (bag.robot, bag.n_steps, bag.closed) == ('biped', N_STEPS + 1, True)
    assert bag.voxel_names == walk.voxels
    assert bag.physics == 'reference'
    np.testing.assert_array_equal(bag.centers, walk.centers)
    np.testing.assert_array_equal(bag.readings[:-1], walk.readings)
    np.testing.assert_array_equal(bag.actuation[:-1], walk.actuation)
    np.testing.assert_array_equal(bag.spikes[:-1], walk.spikes)
    assert bag.spikes.dtype == np.uint8
    assert bag.values is None
    assert bag.heard[:-1].all()
    # At the last step the robot only says where it is.
    assert np.isnan(bag.readings[-1]).all()
    assert not bag.heard[-1].any()
    assert bag.rate == pytest.approx(500.0, rel=1e-3)
    assert sum(c.lost for c in bag.counts) == 0
    assert count_of(bag, '/biped/markers').missing is None
    assert count_of(bag, '/biped/markers').received == 7


def test_values_of_cells_that_do_not_spike(tmp_path):
    values = np.random.default_rng(0).uniform(-1, 1, (N_STEPS, 2, 4))
    walk = make_walk(N_STEPS)
    walk = Walk(walk.voxels, walk.centers, walk.readings, walk.actuation, values=values)
    bag = read_bag(write_messages(tmp_path / 'bag', messages_of_walk(walk)))
    np.testing.assert_array_equal(bag.values[:-1], values)
    assert bag.spikes is None


@pytest.mark.parametrize(('episode', 'physics'), [
    ('', 'first'), ('5f0c17e2', 'first'), ('r5f0c17e', 'reference'), ('x5f0c17e', 'unknown'),
    ('ψ@5f0c17', 'unknown'),
])
def test_physics_comes_from_the_name_of_the_episode(tmp_path, episode, physics):
    walk = replace(make_walk(N_STEPS), episode=episode)
    assert read_bag(write_messages(tmp_path / 'bag', messages_of_walk(walk))).physics == physics


def test_every_episode_has_its_own_physics_and_forged_names_do_not_count(tmp_path):
    first, second = (
        messages_of_walk(replace(make_walk(N_STEPS), episode=name))
        for name in ('5f0c17e2', 'r5f0c17e')
    )
    forged = joint_state(2, 'voxel_0_0@r0000000', ['voxel_0_0'], np.zeros(1))
    first[2].insert(0, ('/biped/voxel_0_0/actuation', forged))
    bag = write_messages(tmp_path / 'bag', [*first, *second])
    assert [read_bag(bag, episode).physics for episode in (0, 1)] == ['first', 'reference']


def test_the_physics_of_a_bag_without_voxel_messages_is_unknown(tmp_path):
    messages = [[m for m in step if 'voxel' not in m[0]] for step in messages_of_walk(make_walk(5))]
    silent = {'/biped/voxel_0_0/sensors': 'sensor_msgs/msg/JointState'}
    bag = read_bag(write_messages(tmp_path / 'bag', messages, silent=silent))
    assert bag.physics == 'unknown'


def test_voxels_are_in_the_order_of_the_morphology(tmp_path):
    names = ('voxel_10_0', 'voxel_2_1', 'voxel_2_0')
    bag = read_bag(write_messages(tmp_path / 'bag', messages_of_walk(make_walk(3, names))))
    assert bag.voxel_names == ('voxel_2_0', 'voxel_10_0', 'voxel_2_1')


@settings(max_examples=25)
@given(lost=st.sets(
    st.tuples(st.sampled_from(NUMBERED), st.integers(0, N_STEPS - 1)), max_size=40
))
def test_lost_messages_are_counted_and_named(tmp_path_factory, lost):
    folder = tmp_path_factory.mktemp('lost')
    walk = make_walk(N_STEPS)
    bag = read_bag(write_messages(folder / 'bag', without(messages_of_walk(walk), lost)))
    shutil.rmtree(folder)
    for topic in NUMBERED:
        missing = sorted(k for name, k in lost if name == topic)
        found = [c for c in bag.counts if c.topic == topic]
        if len(missing) == N_STEPS and not found:
            continue  # the bag lacks a topic without messages
        assert found[0].missing.tolist() == missing
        assert found[0].sent == N_STEPS + (topic in ('/clock', '/biped/odometry'))
    for i, voxel in enumerate(walk.voxels):
        gone = [k for name, k in lost if name == f'/biped/{voxel}/spikes']
        assert not bag.heard[gone, i].any()
        assert not bag.spikes[gone, i].any()
    gone = [k for name, k in lost if name == '/biped/odometry']
    assert np.isnan(bag.centers[gone]).all()
    assert np.isfinite(np.delete(bag.centers, gone, axis=0)).all()


@pytest.mark.parametrize('storage', STORAGES)
def test_a_topic_of_which_nothing_came_has_lost_everything(tmp_path, storage):
    topic = '/biped/voxel_1_0/spikes'
    messages = without(
        messages_of_walk(make_walk(N_STEPS)), {(topic, k) for k in range(N_STEPS)}
    )
    silent = {topic: 'sensor_msgs/msg/Image', '/rosout': 'rcl_interfaces/msg/Log'}
    bag = read_bag(write_messages(tmp_path / 'bag', messages, storage, silent=silent))
    assert count_of(bag, topic).lost == N_STEPS
    assert count_of(bag, '/rosout').sent == 0
    assert not bag.heard[:, 1].any()
    assert bag.spikes.shape == (N_STEPS + 1, 2, 4, 16)


@pytest.mark.parametrize('topic', ['/clock', '/biped/voxel_1_0/spikes', '/biped/voxel_1_0/sensors'])
def test_a_topic_that_is_not_even_in_the_bag_has_lost_everything(tmp_path, topic):
    messages = without(
        messages_of_walk(make_walk(N_STEPS)), {(topic, k) for k in range(N_STEPS + 1)}
    )
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    assert count_of(bag, topic).lost == N_STEPS
    assert sum(c.lost for c in bag.counts) == N_STEPS


def test_a_voxel_of_which_only_diagnostics_are_left_has_lost_everything(tmp_path):
    messages = messages_of_walk(make_walk(N_STEPS))
    messages[3].append(('/diagnostics', diagnostics('/biped/voxel_1_1', {'steps': 3})))
    messages[4].append(('/diagnostics', diagnostics('/other/voxel_5_5', {'steps': 3})))
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    assert bag.voxel_names == ('voxel_0_0', 'voxel_1_0', 'voxel_1_1')
    assert count_of(bag, '/biped/voxel_1_1/spikes').lost == N_STEPS
    assert sum(c.lost for c in bag.counts) == 3 * N_STEPS


def test_diagnostics_are_summed_over_the_processes_of_a_node(tmp_path):
    messages = messages_of_walk(make_walk(N_STEPS))
    lives = [('a', 5, 4, 1), ('a', 9, 7, 2), ('b', 9, 9, 0), ('b', 12, 11, 1)]
    for k, (process, steps, on_time, lost) in enumerate(lives):
        figures = {
            'steps': steps, 'steps per second': 60.0, 'x/spikes on time': on_time,
            'x/spikes late': 0, 'x/spikes lost': lost, 'remark': 'none',
        }
        messages[k].append(('/diagnostics', diagnostics('/biped/voxel_0_0', figures, process)))
    health = read_bag(write_messages(tmp_path / 'bag', messages)).health['voxel_0_0']
    assert health.n_processes == 2
    assert health.deliveries == {'x/spikes': (18, 0, 3)}
    assert health.values['steps'] == 21
    assert health.values['steps per second'] == 60.0


def test_a_message_recorded_twice_counts_once(tmp_path):
    messages = messages_of_walk(make_walk(N_STEPS))
    messages[4] = messages[4] + messages[4]
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    assert count_of(bag, '/clock').received == N_STEPS + 1


def test_a_reset_starts_an_episode(tmp_path):
    first, second = make_walk(9, seed=1), make_walk(5, seed=2)
    messages = [*messages_of_walk(first)[:-1], *messages_of_walk(second)]
    # A late answer of the first episode comes after step 0 of the second.
    late = joint_state(8, 'voxel_0_0', ['voxel_0_0'], first.actuation[8, 0])
    messages[8] = [m for m in messages[8] if m[0] != '/biped/voxel_0_0/actuation']
    messages[9] = [*messages[9][:2], ('/biped/voxel_0_0/actuation', late), *messages[9][2:]]
    path = write_messages(tmp_path / 'bag', messages)
    last, before = read_bag(path), read_bag(path, episode=0)
    assert (last.episode, last.n_episodes, before.episode) == (1, 2, 0)
    np.testing.assert_array_equal(last.centers, second.centers)
    np.testing.assert_array_equal(last.actuation[:-1], second.actuation)
    np.testing.assert_array_equal(before.centers, first.centers[:-1])
    np.testing.assert_array_equal(before.readings, first.readings)
    assert sum(c.lost for c in last.counts + before.counts) == 0
    with pytest.raises(InvalidInput, match='episode: got 2, expected a number from 0 to 1'):
        read_bag(path, episode=2)


def test_a_reset_before_any_answer(tmp_path):
    messages = [*messages_of_walk(make_walk(9))[:-1], messages_of_step(make_walk(9), 0)[:2]]
    bag = read_bag(write_messages(tmp_path / 'bag', messages))
    assert (bag.n_episodes, bag.n_steps) == (2, 1)
    assert np.isnan(bag.readings).all()


def test_what_a_killed_recorder_left_is_read(tmp_path):
    walk = make_walk(N_STEPS)
    path = write_messages(tmp_path / 'bag', messages_of_walk(walk)[:7], killed=True)
    assert not (path / 'metadata.yaml').exists()
    bag = read_bag(path)
    assert not bag.closed
    np.testing.assert_array_equal(bag.centers, walk.centers[:7])


@pytest.fixture(scope='module')
def killed(tmp_path_factory):
    """What a killed recorder left of `make_walk(N_STEPS)`, and where each step's chunk ends."""
    path = write_messages(
        tmp_path_factory.mktemp('killed') / 'bag', messages_of_walk(make_walk(N_STEPS)), killed=True
    )
    data, at, ends = (path / 'bag.mcap').read_bytes(), 8, []
    while at + 9 < len(data):
        kind, size = struct.unpack_from('<BQ', data, at)
        at += 9 + size
        ends += [at] * (kind == 6)
    assert len(ends) == N_STEPS + 1
    return data, ends


@settings(max_examples=100)
@given(data=st.data())
def test_a_bag_cut_anywhere_is_read_up_to_there(tmp_path_factory, killed, data):
    content, ends = killed
    near = st.sampled_from(ends).flatmap(lambda end: st.integers(end - 2, end + 2))
    end = data.draw(st.one_of(st.integers(0, len(content)), near))
    folder = tmp_path_factory.mktemp('cut')
    (folder / 'bag.mcap').write_bytes(content[:end])
    n_whole = sum(at <= end for at in ends)
    if n_whole:
        bag = read_bag(folder)
        assert not bag.closed
        np.testing.assert_array_equal(bag.centers, make_walk(N_STEPS).centers[:n_whole])
    else:
        assert 'odometry of no robot in 0 topics' in refused(folder)
    shutil.rmtree(folder)


def test_a_damaged_bag_that_was_never_closed_is_refused(tmp_path, killed):
    content, ends = killed
    damaged = bytearray(content)
    damaged[ends[3] - 1500 : ends[3] - 500] = b'\xff' * 1000
    (tmp_path / 'bag.mcap').write_bytes(damaged)
    refused(tmp_path)


def test_what_a_killed_recorder_had_not_committed_is_taken_back(tmp_path, monkeypatch):
    walk = make_walk(40)
    steps = iter(messages_of_walk(walk))
    writers = []

    def first_then_copy():
        yield from itertools.islice(steps, 5)
        storage = writers[0].storage
        storage.conn.commit()
        storage.conn.execute('PRAGMA cache_size = 1')  # the rest is in the file, too
        yield from steps
        shutil.copytree(tmp_path / 'bag', tmp_path / 'killed')

    def open_and_keep(self, opened=synthetic_bag.Writer.open):
        writers.append(self)
        opened(self)

    monkeypatch.setattr(synthetic_bag.Writer, 'open', open_and_keep)
    write_messages(tmp_path / 'bag', first_then_copy(), 'sqlite3')
    assert (tmp_path / 'killed' / 'bag.db3-journal').exists()
    bag = read_bag(tmp_path / 'killed')
    assert (bag.closed, bag.n_steps) == (False, 5)
    np.testing.assert_array_equal(bag.centers, walk.centers[:5])


@pytest.mark.parametrize('storage', STORAGES)
@pytest.mark.parametrize('closed', [True, False])
def test_a_path_may_have_characters_of_uris(tmp_path, storage, closed):
    walk = make_walk(N_STEPS)
    path = write_messages(tmp_path / 'bag', messages_of_walk(walk), storage)
    path = path.rename(tmp_path / 'a#b?mode=rw&c=%41')
    if not closed:
        (path / 'metadata.yaml').unlink()
    bag = read_bag(path)
    assert bag.closed is closed
    np.testing.assert_array_equal(bag.centers, walk.centers)


@pytest.mark.parametrize('storage', STORAGES)
def test_metadata_is_not_needed(tmp_path, storage):
    walk = make_walk(N_STEPS)
    path = write_messages(tmp_path / 'bag', messages_of_walk(walk), storage)
    (path / 'metadata.yaml').unlink()
    bag = read_bag(path)
    assert not bag.closed
    np.testing.assert_array_equal(bag.centers, walk.centers)


def refused(path) -> str:
    """Return the one line with which `path` is refused."""
    with pytest.raises(InvalidInput) as caught:
        read_bag(path)
    text = str(caught.value)
    assert text.startswith(str(path))
    assert 'expected' in text
    assert '\n' not in text
    return text


def test_what_is_no_bag_is_refused(tmp_path):
    assert 'no such folder' in refused(tmp_path / 'nowhere')
    (tmp_path / 'empty').mkdir()
    assert 'metadata.yaml' in refused(tmp_path / 'empty')
    (tmp_path / 'file').write_bytes(b'x')
    assert 'a file' in refused(tmp_path / 'file')


@pytest.mark.parametrize('content', [b'', b'not: [yaml', b'a: 1', b'\xff\xfe\x00', b'[]'])
def test_broken_metadata_is_refused(tmp_path, whole, content):
    path = shutil.copytree(whole, tmp_path / 'bag')
    (path / 'metadata.yaml').write_bytes(content)
    refused(path)


@pytest.mark.parametrize('storage', STORAGES)
@pytest.mark.parametrize('damage', ['random', 'empty', 'cut', 'gone'])
def test_broken_storage_is_refused(tmp_path, storage, damage):
    path = write_messages(tmp_path / 'bag', messages_of_walk(make_walk(N_STEPS)), storage)
    file = next(p for p in path.iterdir() if p.suffix != '.yaml')
    data = file.read_bytes()
    if damage == 'gone':
        file.unlink()
    else:
        random = np.random.default_rng(0).bytes(len(data))
        file.write_bytes({'random': random, 'empty': b'', 'cut': data[: len(data) // 3]}[damage])
    refused(path)


@settings(max_examples=60)
@given(data=st.data())
def test_no_damage_ends_in_a_traceback(tmp_path_factory, whole, data):
    folder = tmp_path_factory.mktemp('damaged')
    path = shutil.copytree(whole, folder / 'bag')
    if data.draw(st.booleans(), label='never closed'):
        (path / 'metadata.yaml').unlink()
    file = path / 'bag.mcap'
    content = bytearray(file.read_bytes())
    for _ in range(data.draw(st.integers(0, 3), label='flips')):
        at = data.draw(st.integers(0, len(content) - 1))
        content[at] ^= data.draw(st.integers(1, 255))
    end = data.draw(st.one_of(st.just(len(content)), st.integers(0, len(content))))
    file.write_bytes(content[:end])
    with contextlib.suppress(InvalidInput):
        assert isinstance(read_bag(path), Recording)
    shutil.rmtree(folder)


def voxel(kind: str) -> str:
    return f'/biped/voxel_0_0/{kind}'


def bad_stamp():
    message = odometry(3, np.zeros(2))
    message.header.stamp.nanosec += 1
    return message


SPIKES = np.zeros((4, 16), np.uint8)
FOREIGN = {
    'no odometry': ([('/clock', clock(3))], 'odometry of no robot in 1 topics'),
    'two robots': (
        [('/a/odometry', odometry(0, np.zeros(2))), ('/b/odometry', odometry(0, np.zeros(2)))],
        'odometry of a, b',
    ),
    'no voxels': ([('/biped/odometry', odometry(0, np.zeros(2)))], 'voxels'),
    'type': (
        [('/biped/odometry', odometry(0, np.zeros(2))), (voxel('spikes'), clock(3))],
        'rosgraph_msgs/msg/Clock',
    ),
}
WRONG = {
    'stamp': ('/biped/odometry', bad_stamp()),
    'far stamp': ('/clock', clock(60 * 10**9)),
    'not finite': ('/biped/odometry', odometry(3, np.full(2, np.nan))),
    'readings': (voxel('sensors'), joint_state(3, 'voxel_0_0', 'ab', np.zeros(2))),
    'no readings': (voxel('sensors'), joint_state(3, 'voxel_0_0', '', np.zeros(0))),
    'pixel': (voxel('spikes'), image(3, 'voxel_0_0', 'mono8', SPIKES + 7)),
    'encoding': (voxel('spikes'), image(3, 'voxel_0_0', 'rgb8', SPIKES)),
    'width': (voxel('spikes'), image(3, 'voxel_0_0', 'mono8', SPIKES[:, :8])),
    'channels': (voxel('spikes'), image(3, 'voxel_0_0', 'mono8', SPIKES[:3])),
    'frame': (voxel('spikes'), image(3, 'voxel_0_1', 'mono8', SPIKES)),
}


@pytest.mark.parametrize('case', FOREIGN)
def test_bags_of_something_else_are_refused(tmp_path, case):
    messages, reason = FOREIGN[case]
    alone = case in ('no odometry', 'two robots', 'no voxels', 'type')
    start = [] if alone else messages_of_walk(make_walk(3))[:3]
    assert reason in refused(write_messages(tmp_path / 'bag', [*start, messages]))


@pytest.mark.parametrize('case', WRONG)
def test_wrong_messages_among_right_ones_are_counted(tmp_path, case):
    """Any process on the network can publish them; neither the nodes nor the report use them."""
    walk = make_walk(5)
    right = messages_of_walk(walk)
    middle = len(right) // 2
    bag = read_bag(write_messages(
        tmp_path / 'bag', [*right[:middle], [WRONG[case]], *right[middle:]]
    ))
    np.testing.assert_array_equal(bag.centers, walk.centers)
    np.testing.assert_array_equal(bag.readings[:5], walk.readings)
    np.testing.assert_array_equal(bag.actuation[:5], walk.actuation)
    assert {c.topic: c.refused for c in bag.counts if c.refused} == {WRONG[case][0]: 1}
    assert sum(c.lost for c in bag.counts) == 0


def test_channels_differ_between_voxels(tmp_path):
    odd = [(voxel('spikes'), image(k, 'voxel_0_0', 'mono8', SPIKES[:3])) for k in range(3)]
    messages = [
        [m for m in step if m[0] != voxel('spikes')] + [odd[k]]
        for k, step in enumerate(messages_of_walk(make_walk(3))[:3])
    ]
    assert 'the same shape in all voxels' in refused(write_messages(tmp_path / 'bag', messages))


def test_bytes_of_another_layout_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(
        synthetic_bag.STORE, 'serialize_cdr', lambda message, kind: b'\x00\x01\x00\x00\x05'
    )
    messages = [[('/biped/odometry', TYPES['nav_msgs/msg/Odometry'](*[None] * 4))]]
    path = write_messages(tmp_path / 'bag', messages)
    monkeypatch.undo()
    assert '/biped/odometry' in refused(path)


def test_recordings_and_films_need_no_ros():
    modules = (
        'recording.bag', 'recording.figures', 'recording.gait', 'recording.report',
        'rendering.film', 'rendering.scene',
    )
    imports = '; '.join(f'import snca_ros.{name}' for name in modules)
    code = f'import sys; sys.modules["rclpy"] = None; {imports}'
    subprocess.run([sys.executable, '-c', code], check=True, timeout=LIMIT)
