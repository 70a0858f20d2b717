import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snca_ros.cell.coding import SNN_STEPS, pack_trains, unpack_trains
from snca_ros.cell.layers import layers_of, n_parameters, pad, padded

SIZES = st.lists(st.integers(1, 30), min_size=2, max_size=4)


@given(SIZES, st.integers(0, 2))
def test_layers_hold_every_parameter_once_and_in_order(sizes, n_evolved):
    n = n_parameters(sizes, n_evolved)
    layers = layers_of(sizes, np.arange(1.0, n + 1), n_evolved)
    flat = np.concatenate([part.ravel() for layer in layers for part in layer])
    assert flat.tolist() == list(range(1, n + 1))
    for layer, pre, post in zip(layers, sizes[:-1], sizes[1:], strict=True):
        assert layer.evolved.shape == (n_evolved, post)
        assert layer.synapses.shape == (pre, post)


def test_parameters_of_two_layers_by_hand():
    first, second = layers_of((2, 1, 2), np.arange(9.0)[:7], 1)
    assert (first.evolved.tolist(), first.synapses.tolist()) == ([[0]], [[1], [2]])
    assert (second.evolved.tolist(), second.synapses.tolist()) == ([[3, 4]], [[5, 6]])


@given(st.integers(1, 40), st.integers(1, 16), st.integers(1, 3))
def test_padding_moves_nothing(n, multiple, k):
    rows = np.arange(1.0, k * n + 1).reshape(k, n)
    for mode, value in (('constant', 0.0), ('edge', rows[-1, -1])):
        wide = pad(rows, multiple, mode)
        assert wide.shape == (k, padded(n, multiple))
        np.testing.assert_array_equal(wide[:, :n], rows)
        assert (wide[-1, n:] == value).all()


@pytest.mark.parametrize(
    ('n', 'multiple', 'expected'), [(1, 8, 8), (8, 8, 8), (9, 8, 16), (3, 1, 3)]
)
def test_whole_items(n, multiple, expected):
    assert padded(n, multiple) == expected


@given(st.lists(st.integers(0, 1), min_size=SNN_STEPS, max_size=SNN_STEPS))
def test_a_train_is_its_spikes(spikes):
    train = pack_trains(np.array([[spikes]], dtype=float))
    assert train.shape == (1, 1)
    assert train[0, 0] == sum(2**h for h, spike in enumerate(spikes) if spike)
    assert unpack_trains(train).tolist() == [[spikes]]
