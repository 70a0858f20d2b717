"""Gait measures of signals and robots with known results."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.synthetic_bag import Walk, make_walk, messages_of_walk, write_messages

from sim_node.model.sensors import soft_normalise
from sim_node.simulation import Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller
from snca_ros.evolution.episode import run_episode
from snca_ros.recording.bag import read_bag
from snca_ros.recording.gait import (
    VIBRATION,
    area_ratios,
    bridge_gaps,
    firing_rates,
    measure_gait,
    peak_frequency,
    power_spectrum,
    spike_times,
    vibration_share,
)


@given(
    periods=st.integers(1, 250), n=st.integers(550, 1500), amplitude=st.floats(1e-3, 1.0),
    phase=st.floats(0.0, 6.28), offset=st.floats(-1.0, 1.0),
)
def test_the_frequency_of_a_sinusoid(periods, n, amplitude, phase, offset):
    time = np.arange(n) / 60.0
    frequency = periods * 60.0 / n
    signal = offset + amplitude * np.sin(2 * np.pi * frequency * time + phase)
    # Taking off the trend shifts a slow wave a little; half a bin is the resolution.
    found = peak_frequency(power_spectrum(signal[:, None]), n)[0]
    assert found == pytest.approx(frequency, abs=0.5 * 60.0 / n)


@pytest.mark.parametrize('signal', [np.zeros(90), np.full(90, 0.3), np.linspace(-1, 1, 91)])
def test_a_constant_signal_has_frequency_0(signal):
    assert peak_frequency(power_spectrum(signal[:, None]), len(signal))[0] == 0.0


@given(
    slow=st.integers(1, 79), fast=st.integers(81, 300), ratio=st.floats(0.0, 4.0),
    phase=st.floats(0.0, 6.28), offset=st.floats(-1.0, 1.0), odd=st.booleans(),
)
def test_vibration_is_the_share_of_power_above_its_frequency(
    slow, fast, ratio, phase, offset, odd
):
    n = 601 if odd else 600  # 10 s: whole periods, but for an odd number of steps
    time = np.arange(n) * 2 * np.pi / n
    # Cosines of whole periods have no trend. The highest frequency that can be, every other step,
    # has twice the power of a swing of its amplitude.
    signal = np.stack([offset + np.cos(slow * time), ratio * np.cos(fast * time)], axis=1)
    above = ratio**2 * (2.0 if 2 * fast == n else 1.0)
    assert vibration_share(signal) == pytest.approx(above / (1.0 + above), abs=0.02)
    assert vibration_share(signal[:, :1]) == pytest.approx(0.0, abs=0.02)


def test_vibration_of_what_is_known():
    assert VIBRATION == 8.0
    time = np.arange(600) / 60.0
    at = np.sin(2 * np.pi * 8.0 * time)[:, None]
    assert vibration_share(at) < 0.01  # not above
    assert vibration_share(np.sin(2 * np.pi * 8.1 * time)[:, None]) > 0.99
    steps = np.sign(np.sin(2 * np.pi * (np.arange(600) + 0.5) / 4.0))[:, None]  # 15 Hz
    assert vibration_share(steps) == pytest.approx(1.0, abs=1e-4)  # a trend is taken off
    every = (-1.0) ** np.arange(600)[:, None]  # 30 Hz
    assert vibration_share(every) == pytest.approx(1.0, abs=1e-4)
    assert vibration_share(np.hstack([steps, 5.0 + 0.0 * steps])) == pytest.approx(1.0, abs=1e-4)
    for still in (np.zeros((90, 2)), np.full((91, 2), 0.3), np.linspace(-1, 1, 91)[:, None]):
        assert vibration_share(still) == 0.0
    assert vibration_share(np.zeros((1, 2))) == 0.0


def test_the_strongest_frequency_is_the_robots(tmp_path):
    n, time = 600, np.arange(600) / 60.0
    actuation = np.stack([
        0.9 * np.sin(2 * np.pi * 2.4 * time), 0.3 * np.sin(2 * np.pi * 7.2 * time)
    ], axis=1)
    walk = make_walk(n)
    walk = Walk(walk.voxels, walk.centers, walk.readings, actuation)
    gait = measure_gait(read_bag(write_messages(tmp_path / 'bag', messages_of_walk(walk))))
    np.testing.assert_allclose(gait.frequencies, [2.4, 7.2], atol=1e-9)
    assert gait.frequency == pytest.approx(2.4)
    assert gait.firing_rates is None
    assert gait.duration == 10.0


def test_firing_rates():
    spikes = np.zeros((120, 3, 2, 16), np.uint8)  # 2 s
    spikes[::2, 0, 0, 5] = 1  # 30 Hz and silence
    spikes[:, 1] = 1  # every SNN step: 960 Hz
    heard = np.ones((120, 3), bool)
    heard[60:, 1] = False
    heard[:, 2] = False
    np.testing.assert_array_equal(firing_rates(spikes, heard), [15.0, 960.0, np.nan])


@given(st.lists(
    st.tuples(*(st.integers(0, n - 1) for n in (9, 3, 4, 16))), unique=True, max_size=30
))
def test_spike_times_name_every_spike(where):
    spikes = np.zeros((9, 3, 4, 16), np.uint8)
    for index in where:
        spikes[index] = 1
    times, rows = spike_times(spikes)
    expected = sorted((16 * k + h, 4 * i + c) for k, i, c, h in where)
    assert sorted(zip(np.rint(times * 960).astype(int), rows, strict=True)) == expected


def test_gaps_are_interpolated():
    nan = np.nan
    signal = np.array([[nan, 1.0, nan], [0.0, nan, nan], [nan, 3.0, nan], [2.0, nan, nan]])
    expected = [[0.0, 1.0, 0.0], [0.0, 2.0, 0.0], [1.0, 3.0, 0.0], [2.0, 3.0, 0.0]]
    np.testing.assert_array_equal(bridge_gaps(signal), expected)


def test_area_ratios_are_those_of_the_body():
    simulation = Simulation('worm-2x1')
    rng = np.random.default_rng(0)
    for _ in range(60):
        readings = simulation.step(rng.uniform(-1, 1, 2))
        found = area_ratios(readings[np.newaxis])[0]
        np.testing.assert_allclose(found, simulation.world.area_ratios, atol=1e-12)


def test_area_readings_at_the_ends_of_the_range_stay_finite():
    readings = np.array([[[0.0, 0, 0, 0], [1.0, 0, 0, 0]]])
    low, high = area_ratios(readings)[0]
    assert low < soft_normalise(0.5, 0.5, 1.5)
    assert np.isfinite([low, high]).all()
    assert high > 1.5


@pytest.mark.parametrize('duration', [2.0, 7.0])
def test_velocity_is_the_offline_one_bit_for_bit(tmp_path, duration):
    simulation = Simulation('worm-3x1')
    architecture = Architecture.named('U-nD', 'mlp')
    n = architecture.n_parameters(3)
    theta = np.random.default_rng(1).uniform(-1, 1, n)
    controller = Controller(architecture, simulation.morphology, theta)
    episode = run_episode(simulation, controller, duration)
    steps = len(episode.centers) - 1
    walk = make_walk(steps, simulation.morphology.voxel_names)
    walk = Walk(walk.voxels, episode.centers, walk.readings, walk.actuation)
    gait = measure_gait(read_bag(write_messages(tmp_path / 'bag', messages_of_walk(walk))))
    assert gait.velocity == episode.velocity()
    assert gait.velocity != 0.0
    assert gait.distance == episode.centers[-1, 0] - episode.centers[0, 0]
    assert gait.duration == duration


def test_lost_odometry_does_not_shift_the_transient(tmp_path):
    walk = make_walk(420)
    x = 3.0 * np.arange(421) / 60.0
    x[:300] = 0.0  # it does not walk before the transient is over
    walk = Walk(walk.voxels, np.stack([x, x], axis=1), walk.readings, walk.actuation)
    messages = messages_of_walk(walk)
    for k in (0, 1, 2, 350, 419, 420):
        messages[k] = [m for m in messages[k] if m[0] != '/biped/odometry']
    gait = measure_gait(read_bag(write_messages(tmp_path / 'bag', messages)))
    assert gait.velocity == pytest.approx(3.0)
    assert gait.duration == pytest.approx(415 / 60)
