"""Outages and broken parts: who, when, how; the same in both engines, from any step."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_node.errors import InvalidInput
from sim_node.model.body_faults import (
    STREAMS,
    Breakage,
    Outage,
    parse_breakage,
    parse_outage,
    uniform,
)
from sim_node.model.morphology import parse_morphology
from sim_node.simulation import Simulation

BIPED = parse_morphology('biped')
N_STEPS = 60
ENGINES = pytest.mark.parametrize('engine', ['pymunk', 'batched'])


@given(st.integers(0, 2**31 - 1), st.sampled_from(STREAMS), st.integers(0, 500), st.integers(1, 8))
def test_numbers_of_a_step_do_not_depend_on_where_one_starts(seed, stream, first, n):
    from_start = uniform(seed, stream, (1, 2), 0, first + n)
    np.testing.assert_array_equal(uniform(seed, stream, (1, 2), first, n), from_start[first:])


def test_every_seed_stream_and_voxel_has_numbers_of_its_own():
    places = [(0, 'loss', (0, 0)), (1, 'loss', (0, 0)), (0, 'death', (0, 0)), (0, 'loss', (1, 0)),
              (0, 'loss', (0, 1))]
    numbers = np.array([uniform(*place, 0, 2000) for place in places])
    assert len(np.unique(numbers)) == numbers.size
    assert numbers.mean() == pytest.approx(0.5, abs=0.01)
    assert np.abs(np.corrcoef(numbers.reshape(len(places), -1)) - np.eye(len(places))).max() < 0.05


@pytest.mark.parametrize(('text', 'expected'), [
    ('0.5', Outage(0.5)),
    ('1@10', Outage(1.0, 10.0)),
    ('.25@0.5-1.', Outage(0.25, 0.5, 1.0)),
    ('voxel_0_0', Outage(('voxel_0_0',))),
    ('voxel_0_0+voxel_1_0@5-8', Outage(('voxel_0_0', 'voxel_1_0'), 5.0, 8.0)),
    ('', None),
])
def test_outages_are_read(text, expected):
    assert parse_outage('death', text) == expected
    assert parse_breakage('b', f'zero:{text}' if text else '') == (
        Breakage('zero', expected) if expected else None
    )


@pytest.mark.parametrize('text', [
    '1.5', '-0.1', '0.5@', '0.5@10-5', '0.5@5-5', '0.5@-5', '@5', 'nan@5', '0.5@1e3', ' ', '0.5@5-',
    None, 0.5, ['voxel_0_0'],
])
def test_bad_outages_are_named(text):
    with pytest.raises(InvalidInput, match='death: got'):
        parse_outage('death', text)


@pytest.mark.parametrize('text', ['0.5', 'zero', 'zero:', 'zeros:0.5', 'frozen:2', ':0.5', None, 3])
def test_bad_breakages_are_named(text):
    with pytest.raises(InvalidInput, match='broken_sensors'):
        Simulation('1', broken_sensors=text)


@given(st.text(alphabet='zero:frozen.0159@-+voxel_ \n\0½', max_size=30) | st.text(max_size=20))
def test_any_text_is_read_or_refused(text):
    for parse in (parse_outage, parse_breakage):
        with contextlib.suppress(InvalidInput):
            parse('faults', text)


def test_share_picks_voxels_in_an_order_of_the_seed():
    order = []
    for count in range(BIPED.n_voxels + 1):
        chosen = Outage(count / BIPED.n_voxels).affected_voxels(BIPED, 3, 'death')
        assert chosen.sum() == count
        assert chosen[order].all()  # those before stay
        order += [i for i in np.flatnonzero(chosen) if i not in order]
    assert order != sorted(order)
    half = {tuple(Outage(0.5).affected_voxels(BIPED, seed, 'death')) for seed in range(10)}
    assert len(half) > 5


def test_unknown_voxel_is_named():
    with pytest.raises(InvalidInput, match="broken_actuators: voxel: got 'voxel_9_9'"):
        Simulation('biped', broken_actuators='zero:voxel_0_0+voxel_9_9')


def test_outage_lasts_from_begin_until_end():
    steps = np.arange(200)
    assert Outage(1.0, 0.5, 1.0).covers(steps).nonzero()[0].tolist() == list(range(30, 60))
    assert Outage(1.0, 1.0).covers(steps).nonzero()[0].tolist() == list(range(60, 200))


def actuation(step):
    """Return what all voxels are told at a step."""
    return np.sin(0.2 * step + np.arange(3))


def run(tell=actuation, **options):
    """Return (N_STEPS + 1, 3, 4) readings and (N_STEPS + 1, 2) centres of a robot of 3 voxels."""
    simulation = Simulation('11-10', **options)
    for _ in range(2):  # the second time is not another
        readings, centers = [simulation.reset()], [simulation.center]
        for k in range(N_STEPS):
            told = tell(k)
            readings.append(simulation.step(told))
            centers.append(simulation.center)
            np.testing.assert_array_equal(told, tell(k))  # the caller's array is the caller's
    return np.array(readings), np.array(centers)


@ENGINES
@pytest.mark.parametrize('noise', [0.0, 0.1])
def test_broken_sensors(engine, noise):
    options = {'engine': engine, 'sensor_noise': noise, 'seed': 4}
    sound, centers = run(**options)
    for kind in ('zero', 'frozen', 'random'):
        where = 'voxel_0_0+voxel_1_1@0.25-0.5'
        readings, same = run(broken_sensors=f'{kind}:{where}', **options)
        np.testing.assert_array_equal(same, centers)
        broken = readings[15:30, [0, 2]]
        expected = sound.copy()
        expected[15:30, [0, 2]] = {'zero': 0.0, 'frozen': sound[14, [0, 2]], 'random': broken}[kind]
        np.testing.assert_array_equal(readings, expected)
        if kind == 'random':
            assert len(np.unique(broken)) == broken.size
            assert broken.min() >= 0.0
            assert broken.max() < 1.0


@ENGINES
def test_sensors_frozen_from_the_start_keep_their_first_reading(engine):
    sound, _ = run(engine=engine)
    readings, _ = run(engine=engine, broken_sensors='frozen:1')
    np.testing.assert_array_equal(readings, np.broadcast_to(sound[0], readings.shape))


@ENGINES
@pytest.mark.parametrize(('kind', 'instead'), [
    ('zero', lambda k: 0.0), ('frozen', lambda k: actuation(14)[1]),
    ('random', lambda k: -1.0 + 2.0 * uniform(6, 'broken_actuators', (0, 1), k, 1)[0, 0]),
])
def test_broken_actuators_act_as_if_told_so(engine, kind, instead):
    def told(step):
        values = actuation(step)
        if 15 <= step < 30:
            values[1] = instead(step)
        return values

    assert Simulation('11-10').morphology.squares[1] == (0, 1)
    expected = run(told, engine=engine)
    got = run(engine=engine, broken_actuators=f'{kind}:voxel_0_1@0.25-0.5', seed=6)
    np.testing.assert_array_equal(got[0], expected[0])
    np.testing.assert_array_equal(got[1], expected[1])
    assert not np.array_equal(got[1], run(engine=engine)[1])


def test_many_steps_drawn_at_once_are_the_same():
    options = {'broken_sensors': 'random:0.5@0.05', 'broken_actuators': 'random:0.7@0.1-0.5'}
    a, b = (Simulation('biped', sensor_noise=0.5, seed=9, **options) for _ in range(2))
    many, rows = a.disturbance(40), []
    for k in range(40):
        b.step_count = k
        rows.append(b.disturbance(1))
    for part, single in zip(many, zip(*rows, strict=True), strict=True):
        np.testing.assert_array_equal(part, np.concatenate(single))
    assert [part.shape for part in many] == [(40, 10), (40, 10, 4), (40, 10, 4)]
    nothing = Simulation('biped').disturbance(7)
    assert [part.shape for part in nothing] == [(7, 0), (7, 0, 4), (7, 0, 4)]
