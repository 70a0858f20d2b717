"""Arithmetic and functions of lanes, compared with numpy in extended precision."""

import math
import subprocess
import sys

import numpy as np
import pytest
from numba import typeof

from sim_node.numerics.elementary_functions import expm1, floor, sine_cosine, tanh
from sim_node.numerics.jit import compiled
from sim_node.numerics.lane_array import zeros
from sim_node.numerics.lanes import (
    any_lane,
    bits_of,
    like,
    load,
    mask_like,
    select,
    store,
)


@compiled
def _arithmetic(a):
    for i in range(a.shape[0]):
        x, y = load(a, i, 0), load(a, i, 1)
        smaller = (x < y) & ~(x < 0.0)
        store(a, i, 2, select(smaller | (y >= 2.0), math.sqrt(abs(x)) / 3, -y * 0.5))
        store(a, i, 3, max(min(x + y, x - y), like(x, -1.0)))
        store(a, i, 4, 1.0 if any_lane(smaller) else 0.0)


@compiled
def _sine_cosine(angles, results):
    for i in range(angles.shape[0]):
        s, c = sine_cosine(load(angles, i, 0))
        store(results, i, 0, s)
        store(results, i, 1, c)


@pytest.mark.parametrize('width', [1, 4, 16])
def test_arithmetic_acts_lane_by_lane(width):
    array = zeros((50, 5), width)
    floats = array['lane']
    floats[:] = np.random.default_rng(0).normal(0.0, 2.0, floats.shape)
    x, y = floats[:, 0].copy(), floats[:, 1].copy()
    _arithmetic(array)
    smaller = (x < y) & ~(x < 0.0)
    chosen = np.where(smaller | (y >= 2.0), np.sqrt(np.abs(x)) / 3, -y * 0.5)
    np.testing.assert_array_equal(floats[:, 2], chosen)
    np.testing.assert_array_equal(floats[:, 3], np.maximum(np.minimum(x + y, x - y), -1.0))
    some = np.repeat(smaller.any(axis=1)[:, None], width, axis=1)
    np.testing.assert_array_equal(floats[:, 4], some.astype(float))


@pytest.mark.parametrize('extent', [1.0, 100.0, 1e5])
def test_sine_and_cosine(extent):
    angles, results = zeros((2000, 1), 16), zeros((2000, 2), 16)
    angles['lane'][:] = np.random.default_rng(1).uniform(-extent, extent, angles['lane'].shape)
    _sine_cosine(angles, results)
    exact = angles['lane'][:, 0].astype(np.longdouble)
    assert np.abs(results['lane'][:, 0] - np.sin(exact)).max() < 2e-16
    assert np.abs(results['lane'][:, 1] - np.cos(exact)).max() < 2e-16


@compiled
def _masks(a, bits):
    for i in range(a.shape[0]):
        x = load(a, i, 0)
        bits[i] = bits_of(x > 0.0)
        store(a, i, 1, select(mask_like(x, bits[i]), 1.0, 0.0))


@pytest.mark.parametrize('width', [1, 4, 16, 64])
def test_masks_are_integers_with_a_bit_per_lane(width):
    array, bits = zeros((50, 2), width), np.zeros(50, dtype=np.int64)
    floats = array['lane']
    floats[:] = np.random.default_rng(3).normal(0.0, 1.0, floats.shape)
    _masks(array, bits)
    positive = floats[:, 0] > 0.0
    np.testing.assert_array_equal(bits[:, None] >> np.arange(width) & 1, positive)
    np.testing.assert_array_equal(floats[:, 1], positive)


@compiled
def _of_lanes(a):
    for i in range(a.shape[0]):
        x = load(a, i, 0)
        s, c = sine_cosine(x)
        for field, value in enumerate((tanh(x), floor(x), s, c, expm1(x))):
            store(a, i, 1 + field, value)


@compiled
def _of_numbers(xs, results):
    for i in range(xs.shape[0]):
        s, c = sine_cosine(xs[i])
        results[i] = tanh(xs[i]), floor(xs[i]), s, c, expm1(xs[i])


def test_functions_of_lanes_equal_those_of_numbers():
    array = zeros((500, 6), 8)
    floats = array['lane']
    floats[:, 0] = np.random.default_rng(4).normal(0.0, 10.0, (500, 8))
    floats[:4, 0] = np.array([0.0, -0.0, 7.0, -7.0])[:, None]
    _of_lanes(array)
    numbers = np.empty((4000, 5))
    _of_numbers(floats[:, 0].ravel(), numbers)
    alone = numbers.reshape(500, 8, 5).transpose(0, 2, 1)
    np.testing.assert_array_equal(floats[:, 1:].view(np.int64), alone.copy().view(np.int64))
    np.testing.assert_array_equal(floats[:, 2], np.floor(floats[:, 0]))


def test_items_of_a_lane_array_are_plain_and_its_transpose_has_no_type():
    array = zeros((3, 2), 4)
    array['lane'] = 1.0
    assert type(array['lane']) is type(array[1:]) is np.ndarray
    assert array['lane'].sum() == 24.0
    with pytest.raises(ValueError, match='Cannot determine Numba type'):
        typeof(array.T)


def test_cached_functions_of_different_widths_have_different_names():
    name = (
        'from numba import typeof; from numba.core.itanium_mangler import mangle_type;'
        'from sim_node.numerics.lane_array import zeros;'
        'print(mangle_type(typeof(zeros((1, 1), {}))))'
    )
    names = [
        subprocess.run(
            [sys.executable, '-c', name.format(width)], check=True, capture_output=True, text=True
        ).stdout
        for width in (1, 4)
    ]
    assert names[0] != names[1]
