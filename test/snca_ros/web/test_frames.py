"""Frames: packed numbers and averages, as the page receives them."""

import base64
import math
import zlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from support.made_recording import made_recording

from sim_node.errors import InvalidInput
from snca_ros.web.frames import MAX_FRAMES, Packed, make_frames

NUMBERS = st.floats(-1e3, 1e3) | st.just(math.nan)


def unpacked(packed):
    raw = packed.raw
    if raw.dtype.kind == 'f':
        return raw
    none = np.iinfo(raw.dtype).max
    return np.where(raw == none, np.nan, packed.low + packed.step * raw.astype(float))


@given(arrays(np.float64, (5, 3), elements=NUMBERS))
def test_packed_numbers_are_unpacked_to_their_precision(numbers):
    packed = Packed.fitting(numbers)
    np.testing.assert_allclose(unpacked(packed), numbers, atol=0.51 * packed.step)
    assert packed.step <= 2000.0 / 65534


@given(arrays(np.float64, 7, elements=NUMBERS))
def test_numbers_out_of_range_are_clipped(numbers):
    packed = Packed.between(numbers, -1.0, 1.0)
    np.testing.assert_allclose(unpacked(packed), np.clip(numbers, -1.0, 1.0), atol=0.004)


def test_frames_are_the_walk():
    recording = made_recording()
    frames = make_frames(recording)
    shown = {name: unpacked(packed) for name, packed in frames.arrays.items()}
    assert frames.stride == 2
    np.testing.assert_allclose(shown['x'], recording.centers[::2, 0], atol=1e-4)
    corners = shown['corners'].reshape(60, 3, 4, 2) + recording.centers[::2, None, None]
    np.testing.assert_allclose(corners, recording.poses.corners, atol=1e-3)
    np.testing.assert_allclose(shown['actuation'], recording.actuation[::2], atol=0.004)
    np.testing.assert_allclose(shown['v_x'], 3.0, atol=1e-3)
    trains = frames.arrays['messages'].raw
    bits = trains[..., None] >> np.arange(16) & 1
    np.testing.assert_array_equal(bits, recording.spikes)


def test_rates_are_means_over_a_second_of_the_messages_received():
    spikes = np.zeros((180, 2, 4, 16), dtype=np.uint8)
    spikes[60:120, 0, :, 0] = 1  # 60 Hz for the second second
    heard = np.ones((180, 2), dtype=bool)
    heard[:, 1] = False
    frames = make_frames(made_recording(180, 2, spikes=spikes, heard=heard))
    rates = unpacked(frames.arrays['rate'])
    assert rates[45, 0] == pytest.approx(60.0, abs=1.0)
    assert rates[30, 0] == pytest.approx(30.0, abs=1.0)
    assert rates[0, 0] == rates[89, 0] == 0.0
    assert np.isnan(rates[:, 1]).all()


def test_unknown_numbers_stay_unknown():
    recording = made_recording()
    recording.readings[40:60] = np.nan
    area = unpacked(make_frames(recording).arrays['area'])
    assert np.isnan(area[20:30]).all()
    assert np.isfinite(area[:20]).all()


def test_long_walks_are_thinned_to_a_limit():
    recording = made_recording(2 * 2 * MAX_FRAMES + 1, 1)
    frames = make_frames(recording)
    assert frames.stride == 6
    assert len(frames.arrays['x'].raw) <= MAX_FRAMES
    assert len(frames.arrays['messages'].raw) == recording.n_steps


def test_the_bytes_are_the_arrays_in_the_order_described():
    frames = make_frames(made_recording())
    data = zlib.decompress(base64.b64decode(frames.encode()))
    begin = 0
    for told in frames.describe():
        dtype = np.dtype(told['type'])
        assert begin % dtype.itemsize == 0
        count = math.prod(told['shape'])
        found = np.frombuffer(data, dtype.newbyteorder('<'), count, begin).reshape(told['shape'])
        np.testing.assert_array_equal(found, frames.arrays[told['name']].raw)
        begin += count * dtype.itemsize
    assert begin == len(data)


def test_a_bag_without_markers_is_refused():
    with pytest.raises(InvalidInput, match=r'bag: markers.*expected a bag with /robot/markers'):
        make_frames(made_recording(poses=None))
