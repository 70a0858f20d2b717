import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_node.numerics.elementary_functions import expm1, sine_cosine, tanh
from sim_node.numerics.jit import compiled


@compiled
def tanh_of_all(x, y):
    for i in range(x.shape[0]):
        y[i] = tanh(x[i])


def units_off(value, exact):
    """Return the error in units in the last place of `exact`, given in extended precision."""
    return np.abs((value - exact) / np.spacing(np.abs(exact.astype(float))))


@pytest.mark.parametrize('scale', [1e-300, 1e-8, 1e-3, 0.1, 1.0, 10.0])
def test_tanh_is_accurate(scale):
    x = scale * np.random.default_rng(0).normal(size=20000)
    y = np.empty_like(x)
    tanh_of_all(x, y)
    assert units_off(y, np.tanh(x.astype(np.longdouble))).max() < 3


def test_expm1_is_accurate():
    for x in np.random.default_rng(1).uniform(-700, 700, 2000):
        assert expm1(x) == pytest.approx(math.expm1(x), rel=1e-14)
    for x in 10.0 ** np.arange(-300.0, 1.0):
        assert expm1(x) == pytest.approx(math.expm1(x), rel=5e-16)


@given(st.floats(-1e308, 1e308))
def test_tanh_is_odd_and_bounded(x):
    assert tanh(-x) == -tanh(x)
    assert abs(tanh(x)) <= 1.0


@pytest.mark.parametrize('scale', [1e-9, 1.0, 7.0, 1e5])
def test_sine_and_cosine_are_accurate(scale):
    for x in scale * np.random.default_rng(2).normal(size=2000):
        assert sine_cosine(x) == pytest.approx((math.sin(x), math.cos(x)), rel=0, abs=2.3e-16)


def test_sine_and_cosine_of_multiples_of_a_quarter_turn():
    for k in range(-9, 10):
        exact = math.sin(k * math.pi / 2), math.cos(k * math.pi / 2)
        assert sine_cosine(k * math.pi / 2) == pytest.approx(exact, rel=0, abs=2.3e-16)
    assert all(math.isnan(y) for y in sine_cosine(math.nan))


def test_tanh_at_the_limits():
    assert [tanh(x) for x in (0.0, 20.0, math.inf, -math.inf)] == [0.0, 1.0, 1.0, -1.0]
    assert math.isnan(tanh(math.nan))


@pytest.mark.parametrize('n', [1, 3, 8, 17, 40])
def test_arrays_give_the_bits_of_single_numbers(n):
    x = np.random.default_rng(n).normal(size=n)
    y = np.empty(n)
    tanh_of_all(x, y)
    assert y.tolist() == [tanh(v) for v in x]


def test_bits_are_the_same_everywhere():
    """The expected bits were computed on x86-64 with 512-bit vectors."""
    assert [tanh(x).hex() for x in (0.1, 0.5, 1.0, 2.5)] == BITS


BITS = [
    '0x1.983d7795f413bp-4', '0x1.d9353d7568af3p-2', '0x1.85efab514f394p-1', '0x1.f9258260a71c2p-1',
]
