"""Cells against the reference cell: spikes exactly, values to 1e-12."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.against_reference import (
    COMBINATIONS,
    HIDDEN,
    MODELS,
    SPIKING,
    WEIGHTS,
    as_inbox,
    assert_same,
    cheap,
    draw_inboxes,
    draw_readings,
    draw_weights,
    make_architecture,
)
from support.reference_cell import (
    RateEncoder,
    ReferenceCell,
    n_weights_of,
    sizes_of,
)

from snca_ros.cell.cells import Cells

dear = settings(max_examples=14)


class Pair:
    """The same cell(s) twice, in the project and in the reference."""

    def __init__(self, combination, model, n_c, hidden, weights, as_printed=False):
        self.model = model
        self.architecture = make_architecture(combination, model, n_c, hidden, as_printed)
        self.cells = Cells(self.architecture, np.array(weights, dtype=float))
        directional = COMBINATIONS[combination][1]
        self.references = [
            ReferenceCell(model, n_c, directional, hidden, w.tolist(), as_printed)
            for w in np.asarray(weights, dtype=float)
        ]

    def step(self, i, readings, inbox, k):
        """Step cell i on both sides, compare, and return (a, outbox) of the project."""
        a = self.cells.step_cell(i, readings.copy(), inbox.copy(), k)
        outbox = np.array(self.cells.outbox[i])
        r, messages = readings.tolist(), as_inbox(self.model, inbox)
        expected = self.references[i].step(r, messages, k)
        assert_same(self.model, (a, outbox), expected, f'cell {i}, control step {k}')
        return a, outbox


@pytest.mark.parametrize('model', MODELS)
@pytest.mark.parametrize('combination', COMBINATIONS)
@dear
@given(
    n_c=st.integers(1, 4),
    hidden=st.sampled_from(HIDDEN),
    kind=st.sampled_from(WEIGHTS),
    as_printed=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
def test_cell_is_the_reference(combination, model, n_c, hidden, kind, as_printed, seed):
    rng = np.random.default_rng(seed)
    n_steps = 200
    sizes = sizes_of(n_c, COMBINATIONS[combination][1], hidden)
    weights = draw_weights(rng, kind, (1, n_weights_of(model, sizes)))
    pair = Pair(combination, model, n_c, hidden, weights, as_printed and model != 'mlp')
    readings = draw_readings(rng, n_steps, 1)
    inboxes = draw_inboxes(rng, n_steps, model, n_c)
    for k in range(n_steps):
        pair.step(0, readings[k, 0], inboxes[k], k)


@pytest.mark.parametrize('as_printed', [False, True])
@pytest.mark.parametrize('model', SPIKING)
def test_spiking_cell_is_the_reference_over_long_and_busy_runs(model, as_printed):
    rng = np.random.default_rng(5)
    n_steps = 400
    n_spikes, actuation = 0, set()
    for kind in WEIGHTS:
        weights = draw_weights(rng, kind, (1, 500))
        pair = Pair('U-nD', model, 4, None, weights, as_printed)
        readings = draw_readings(rng, n_steps, 1)
        inboxes = (rng.uniform(0, 1, (n_steps, 4, 4, 16)) < 0.05).astype(float)
        for k in range(n_steps):
            a, outbox = pair.step(0, readings[k, 0], inboxes[k], k)
            n_spikes += outbox.sum()
            if k >= 4:
                actuation.add(round(a, 9))
    # Some weights keep a silent throughout, some at its maximum; not all three of them.
    assert 0 < n_spikes < 3 * 4 * 16 * n_steps
    assert len(actuation) > 1
    assert actuation <= {-1, -0.52, -0.04, 0.44, 0.92, 1}


@pytest.mark.parametrize('model', MODELS)
def test_cells_do_not_disturb_each_other(model):
    rng = np.random.default_rng(6)
    n_steps, n_cells, n_c = 60, 3, 2
    n_weights = n_weights_of(model, sizes_of(n_c, True, (5,)))
    pair = Pair('nU-D', model, n_c, (5,), draw_weights(rng, 'normal', (n_cells, n_weights)))
    readings = draw_readings(rng, n_steps, n_cells)
    inboxes = draw_inboxes(rng, n_steps * n_cells, model, n_c)
    for k in range(n_steps):
        for i in rng.permutation(n_cells):
            pair.step(i, readings[k, i], inboxes[n_cells * k + i], k)


@pytest.mark.parametrize('model', MODELS)
def test_cells_start_anew_after_reset(model):
    rng = np.random.default_rng(7)
    n_weights = n_weights_of(model, sizes_of(1, True, None))
    weights = draw_weights(rng, 'normal', (1, n_weights))
    readings = draw_readings(rng, 80, 1)
    inboxes = draw_inboxes(rng, 80, model, 1)
    cells = Pair('U-D', model, 1, None, weights).cells
    for k in range(33):
        cells.step_cell(0, readings[79 - k, 0], inboxes[79 - k], k)
    cells.reset()
    assert not np.any(cells.outbox)
    fresh = Pair('U-D', model, 1, None, weights)
    fresh.cells = cells
    for k in range(80):
        fresh.step(0, readings[k, 0], inboxes[k], k)


@cheap
@given(
    n_c=st.integers(1, 4),
    hidden=st.sampled_from([h for h in HIDDEN if h is not None]),
    kind=st.sampled_from(WEIGHTS),
    seed=st.integers(0, 2**32 - 1),
)
def test_neuron_whose_every_synapse_spikes_from_rest_fires(n_c, hidden, kind, seed):
    # At h = 0 all inputs spike, v = sum of weights and theta = min(1, sum of weights) <= v: a
    # tie whenever that sum is below 1, which rounding (another order of summing) must not break.
    rng = np.random.default_rng(seed)
    weights = draw_weights(rng, kind, (1, n_weights_of('snn-h', sizes_of(n_c, False, hidden))))
    pair = Pair('U-nD', 'snn-h', n_c, hidden, weights)
    a, outbox = pair.step(0, rng.uniform(0, 1, 4), np.ones((4, n_c, 16)), 0)
    assert a > -1
    assert np.all(outbox[:, :, 0] == 1)


@pytest.mark.parametrize('model', SPIKING)
def test_synchronous_inputs_are_the_reference(model):
    # All inputs carry the same train, so that exact ties keep coming up.
    rng = np.random.default_rng(8)
    for kind in WEIGHTS:
        pair = Pair('U-nD', model, 2, (7,), draw_weights(rng, kind, (1, 12 * 7 + 7 * 3)))
        encoder = RateEncoder()
        for k in range(200):
            train = encoder.encode(1.0, 16 * k)
            pair.step(0, np.ones(4), np.tile(np.array(train, dtype=float), (4, 2, 1)), k)
