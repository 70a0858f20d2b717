import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from snca_ros.cell.coding import SNN_STEPS, count_spikes, pack_trains, unpack_trains
from snca_ros.cell.layers import LANES, n_synapses, pad_synapses, padded, synapses_by_layer

SIZES = st.lists(st.integers(1, 30), min_size=2, max_size=4)


@given(SIZES, st.booleans())
def test_padding_moves_no_weight_and_adds_none(sizes, bias):
    n = n_synapses(sizes, bias)
    weights = np.arange(1.0, n + 1)
    flat = pad_synapses(sizes, weights, bias)
    assert flat[flat != 0].tolist() == weights.tolist()
    rows = [pre + bias for pre in sizes[:-1]]
    assert len(flat) == sum(r * padded(post) for r, post in zip(rows, sizes[1:], strict=True))


def test_synapses_of_two_layers_by_hand():
    first, second = synapses_by_layer((2, 1, 2), np.arange(9.0)[:7], bias=True)
    assert first.tolist() == [[0], [1], [2]]  # bias, then presynaptic neurons
    assert second.tolist() == [[3, 4], [5, 6]]


@pytest.mark.parametrize(('n', 'expected'), [(1, 8), (8, 8), (9, 16), (20, 24)])
def test_whole_vectors(n, expected):
    assert (LANES, padded(n)) == (8, expected)


@given(st.lists(st.integers(0, 1), min_size=SNN_STEPS, max_size=SNN_STEPS))
def test_a_train_is_its_spikes(spikes):
    train = pack_trains(np.array([[spikes]], dtype=float))
    assert train.shape == (1, 1)
    assert train[0, 0] == sum(2**h for h, spike in enumerate(spikes) if spike)
    assert unpack_trains(train).tolist() == [[spikes]]
    assert count_spikes(int(train[0, 0])) == sum(spikes)
