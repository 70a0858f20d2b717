"""The cell and the controller against a second, plain implementation (reference_cell.py).

First the reference is held against what can be worked out by hand, then the project against the
reference: spikes exactly, values to 1e-12.
"""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.reference_cell import (
    DIRECTIONS,
    OPPOSITE,
    ActuationDecoder,
    LifNeuron,
    Mlp,
    RateEncoder,
    ReferenceCell,
    ReferenceController,
    SpikingNetwork,
    n_weights_of,
    sizes_of,
)

from sim_node.model.morphology import parse_morphology
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cells import Cells
from snca_ros.controller import Controller

MODELS = ('mlp', 'snn', 'snn-h')
SPIKING = ('snn', 'snn-h')
COMBINATIONS = {'U-nD': (True, False), 'U-D': (True, True), 'nU-D': (False, True)}
HIDDEN = (None, (), (1,), (3,), (7,), (5, 3), (3, 9))
WEIGHTS = ('uniform', 'normal', 'dyadic')
TOLERANCE = 1e-12
Q = 1 - 0.01 * 1000 / 960  # what is left of v, and of psi, after one SNN step

cheap = settings(max_examples=60)
dear = settings(max_examples=14)
dearest = settings(max_examples=5)


# --- what both sides are given --------------------------------------------------------------


def draw_weights(rng, kind, n):
    """Return n weights: U[-1, 1], N(0, 1), or sixteenths, whose sums are exact in any order."""
    if kind == 'uniform':
        return rng.uniform(-1, 1, n)
    if kind == 'normal':
        return rng.normal(0, 1, n)
    return rng.integers(-16, 17, n) / 16


def draw_readings(rng, n_steps, n_cells):
    """Return (n_steps, n_cells, 4) readings; each sensor has its own way of moving in [0, 1]."""
    shape = (n_steps, n_cells, 4)
    noise = rng.uniform(0, 1, shape)
    walk = np.clip(0.5 + np.cumsum(rng.normal(0, 0.05, shape), axis=0), 0, 1)
    contact = (np.cumsum(rng.uniform(0, 1, shape) < 0.1, axis=0) % 2).astype(float)
    ninths = rng.integers(0, 10, shape) / 9  # f is 5, 10, 15, ... 50 Hz
    still = np.broadcast_to(rng.choice([0.0, 0.5, 1.0], (1, n_cells, 4)), shape)
    ways = np.stack([noise, walk, contact, ninths, still])
    way = rng.integers(0, len(ways), (n_cells, 4))
    cell, sensor = np.indices((n_cells, 4))
    return np.ascontiguousarray(np.moveaxis(ways[way, :, cell, sensor], 2, 0))


def draw_inboxes(rng, n_steps, model, n_c):
    """Return (n_steps, 4, n_c, width) messages; trains from silent to a spike at each step."""
    if model == 'mlp':
        return rng.uniform(-1, 1, (n_steps, 4, n_c, 1))
    density = rng.choice([0.0, 0.02, 0.05, 0.3, 1.0], (1, 4, n_c, 1))
    return (rng.uniform(0, 1, (n_steps, 4, n_c, 16)) < density).astype(float)


def as_inbox(model, array):
    """Return a (4, n_c, width) array as the reference's dict of channels."""
    return {d: [as_channel(model, c) for c in array[i]] for i, d in enumerate(DIRECTIONS)}


def as_channel(model, values):
    return float(values[0]) if model == 'mlp' else [int(s) for s in values]


def as_array(model, outbox):
    """Return a reference outbox as a (n_directions, n_c, width) array."""
    sent = [outbox[d] for d in DIRECTIONS] if isinstance(outbox, dict) else [outbox]
    array = np.array(sent, dtype=float)
    return array[..., np.newaxis] if model == 'mlp' else array


def as_outbox(model, array):
    """Return a (n_directions, n_c, width) array as a reference outbox."""
    if len(array) == 4:
        return as_inbox(model, array)
    return [as_channel(model, c) for c in array[0]]


def assert_same(model, ours, theirs, where):
    """Compare (a, outbox) of the project with those of the reference."""
    a, outbox = ours
    assert abs(a - theirs[0]) <= TOLERANCE, where
    expected = as_array(model, theirs[1])
    assert outbox.shape == expected.shape, where
    if model == 'mlp':
        np.testing.assert_allclose(outbox, expected, rtol=0, atol=TOLERANCE, err_msg=where)
    else:
        np.testing.assert_array_equal(outbox, expected, err_msg=where)


# --- the reference by hand: coding ----------------------------------------------------------


def spike_times(readings):
    encoder = RateEncoder()
    train = [s for k, r in enumerate(readings) for s in encoder.encode(r, 16 * k)]
    return [h for h, s in enumerate(train) if s]


@pytest.mark.parametrize(('r', 'period'), [(1.0, 19), (0.0, 192), (0.5, 34), (1 / 3, 48)])
def test_reference_encodes_a_constant_as_one_period(r, period):
    assert spike_times([r] * 200) == list(range(0, 3200, period))


@cheap
@given(st.floats(0, 1))
def test_reference_period_gives_at_least_the_rate_asked_for(r):
    period = spike_times([r] * 40)[1]
    f = 5 + 45 * r
    assert period <= 960 / f * (1 + 1e-12)
    assert period + 1 > 960 / f * (1 - 1e-12)


def test_reference_counts_from_the_last_spike_across_control_steps():
    # r = 0 (192) for two control steps, then r = 1: 19 is past, so the next multiple, 38.
    assert spike_times([0, 0, 1, 1, 1])[:3] == [0, 38, 57]
    # r = 1 until its spike at 19, then 192 steps of r = 0 from there.
    assert spike_times([1, 1] + [0] * 20)[:3] == [0, 19, 211]


def test_reference_actuation_has_six_values_and_silence_is_full_expansion():
    decoder = ActuationDecoder()
    assert [decoder.decode(0) for _ in range(7)] == [-1.0] * 7

    seen = set()
    for n in range(81):
        decoder = ActuationDecoder()
        each = [n // 5 + (i < n % 5) for i in range(5)]
        seen.add(round([decoder.decode(m) for m in each][-1], 12))
    # 50 Hz over 5 / 60 s are 25 / 6 spikes: a = 12 n / 25 - 1.
    assert sorted(seen) == [-1, -0.52, -0.04, 0.44, 0.92, 1]


def test_reference_window_is_shorter_at_the_start_and_forgets_after_five():
    decoder = ActuationDecoder()
    found = [decoder.decode(n) for n in (0, 1, 0, 0, 0, 0, 0)]
    # With m control steps so far one spike is 2 / (50 m / 60) = 2.4 / m above -1.
    expected = [-1, -1 + 2.4 / 2, -1 + 2.4 / 3, -1 + 2.4 / 4, -1 + 2.4 / 5, -1 + 2.4 / 5, -1]
    assert found == pytest.approx(expected, abs=1e-12)
    assert ActuationDecoder().decode(1) == 1.0  # 2.4 - 1, clipped


# --- the reference by hand: neurons ---------------------------------------------------------


@cheap
@given(st.floats(0.012, 1.5))
def test_reference_neuron_under_constant_drive_has_the_period_of_the_closed_form(drive):
    # v after n steps from rest is w (1 - Q^n) / (1 - Q); the period is the first n with v >= 1.
    exact = max(1.0, math.log(1 - (1 - Q) / drive) / math.log(Q))
    if abs(exact - round(exact)) < 1e-6 and drive != 1:
        return  # too near to a whole number to say by logarithms
    period = math.ceil(exact)
    network = SpikingNetwork([1, 1], [drive], homeostasis=False)
    spikes = [network.step([1])[0] for _ in range(5 * period + 1)]
    assert [n + 1 for n, s in enumerate(spikes) if s] == [period * i for i in range(1, 6)] or (
        period == 1 and all(spikes)
    )


def test_reference_neuron_with_too_little_drive_never_fires():
    # w / (1 - Q) < 1 is the limit of v.
    neuron = LifNeuron(1.0, homeostasis=False)
    assert not any(neuron.step(0.999 * (1 - Q)) for _ in range(5000))


def test_reference_homeostasis_of_a_neuron_with_negative_weights():
    # Nothing comes in, v = 0. The threshold is -0.5, -0.3, -0.1 (three spikes), then 0.1 = -0.5
    # + psi with psi = 0.6 Q^m, and no spike until psi <= 0.5.
    neuron = LifNeuron(-0.5, homeostasis=True)
    pause = math.ceil(math.log(0.5 / 0.6) / math.log(Q))
    spikes = [neuron.step(0.0) for _ in range(3 + pause + 1)]
    assert spikes == [1, 1, 1] + [0] * pause + [1]
    assert pause == 18


def test_reference_homeostasis_slows_a_neuron_down():
    plain, homeostatic = LifNeuron(1.0, homeostasis=False), LifNeuron(1.0, homeostasis=True)
    n_plain = sum(plain.step(1.0) for _ in range(2000))
    n_homeostatic = sum(homeostatic.step(1.0) for _ in range(2000))
    assert n_plain == 2000
    assert 0 < n_homeostatic < 500


def test_reference_as_printed_threshold_compounds():
    # Sum of weights 3, and a drive that always makes a spike: psi = 0, 0.2, 0.4, ... and
    # theta = 1 + 0, 1 + 0.2, 1.2 + 0.4, ... until it passes 3, and from there 3 + psi.
    neuron = LifNeuron(3.0, homeostasis=True, as_printed=True)
    thetas = []
    for _ in range(8):
        assert neuron.step(100.0) == 1
        thetas.append(neuron.theta)
    assert thetas == pytest.approx([1, 1.2, 1.6, 2.2, 3.0, 4.0, 4.2, 4.4])

    default = LifNeuron(3.0, homeostasis=True)
    thetas = []
    for _ in range(8):
        assert default.step(100.0) == 1
        thetas.append(default.theta)
    assert thetas == pytest.approx([1, 1.2, 1.4, 1.6, 1.8, 2.0, 2.2, 2.4])


def test_reference_as_printed_neuron_must_exceed_its_threshold_and_hardly_leaks():
    printed, default = LifNeuron(1.0, False, as_printed=True), LifNeuron(1.0, False)
    assert (printed.step(1.0), default.step(1.0)) == (0, 1)
    assert printed.step(0.0) == 0
    assert printed.v == pytest.approx(1 - 0.01 / 960, abs=1e-15)


def test_reference_reads_flat_weights_with_the_presynaptic_index_slow():
    # 2 inputs, 3 outputs: only the weight from input 1 to output 0 is 1, at 1 * 3 + 0.
    network = SpikingNetwork([2, 3], [0, 0, 0, 1, 0, 0], homeostasis=False)
    assert network.step([0, 1]) == [1, 0, 0]
    assert network.step([1, 0]) == [0, 0, 0]
    # Bias row first: output 1 has bias 0.5, and weight 2 from input 0 at (1 + 0) * 2 + 1.
    found = Mlp([1, 2], [0, 0.5, 0, 2]).compute([0.3])
    assert found == pytest.approx([0, math.tanh(0.5 + 2 * math.tanh(0.3))], abs=1e-15)


@pytest.mark.parametrize('as_printed', [False, True])
@pytest.mark.parametrize('model', SPIKING)
def test_reference_silence_is_full_expansion(model, as_printed):
    cell = ReferenceCell(model, 1, True, None, [0.0] * 104, as_printed)
    inbox = {d: [[0] * 16] for d in DIRECTIONS}
    found = [cell.step([0.3, 1, 0, 0.7], inbox, k) for k in range(50)]
    if model == 'snn-h' and not as_printed:
        # A sum of weights of 0 is a threshold of 0: v >= theta until psi has grown, and then
        # never again, as psi stays above 0.
        assert found[0][1]['above'] == [[1] + [0] * 15]
        found = found[5:]
    assert {a for a, _ in found} == {-1.0}
    assert not any(any(channel[0]) for _, o in found for channel in o.values())


# --- the architectures ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ('name', 'model', 'layer_sizes', 'n_weights', 'n_on_biped'),
    [
        ('U-nD', 'snn-h', (20, 20, 5), 500, 500),
        ('U-nD', 'snn', (20, 20, 5), 500, 500),
        ('U-nD', 'mlp', (20, 20, 5), 525, 525),
        ('U-D', 'mlp', (8, 8, 5), 117, 117),
        ('U-D', 'snn', (8, 8, 5), 104, 104),
        ('nU-D', 'mlp', (8, 8, 5), 117, 1170),
        ('nU-D', 'snn-h', (8, 8, 5), 104, 1040),
    ],
)
def test_named_architectures_have_the_sizes_of_the_paper(
    name, model, layer_sizes, n_weights, n_on_biped
):
    architecture = Architecture.named(name, model)
    assert tuple(architecture.layer_sizes) == layer_sizes
    assert architecture.n_inputs == layer_sizes[0]
    assert architecture.n_outputs == layer_sizes[-1]
    assert architecture.weights_per_cell == n_weights
    assert architecture.n_parameters(10) == n_on_biped


@pytest.mark.parametrize('hidden', HIDDEN)
@pytest.mark.parametrize('n_c', [1, 2, 3, 5])
@pytest.mark.parametrize('model', MODELS)
@pytest.mark.parametrize('combination', COMBINATIONS)
def test_sizes_of_architectures(combination, model, n_c, hidden):
    architecture = make_architecture(combination, model, n_c, hidden)
    directional = COMBINATIONS[combination][1]
    sizes = sizes_of(n_c, directional, hidden)
    assert list(architecture.layer_sizes) == sizes
    assert architecture.weights_per_cell == n_weights_of(model, sizes)


def make_architecture(combination, model, n_c, hidden, as_printed=False):
    uniform, directional = COMBINATIONS[combination]
    return Architecture(
        uniform=uniform,
        directional=directional,
        neuron_model=model,
        n_c=n_c,
        hidden=hidden,
        as_printed=as_printed,
    )


# --- single cells ---------------------------------------------------------------------------


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


# --- whole robots ---------------------------------------------------------------------------


def compare_controllers(
    morphology, combination, model, n_c, hidden, kind, seed, n_steps, as_printed=False
):
    """Compare over n_steps; return the number of spikes (or the sum of values) sent."""
    rng = np.random.default_rng(seed)
    uniform, directional = COMBINATIONS[combination]
    architecture = make_architecture(combination, model, n_c, hidden, as_printed)
    n, n_weights = morphology.n_voxels, n_weights_of(model, sizes_of(n_c, directional, hidden))
    assert architecture.n_parameters(n) == n_weights * (1 if uniform else n)
    theta = draw_weights(rng, kind, architecture.n_parameters(n))
    controller = Controller(architecture, morphology, theta.copy())
    controller.reset()
    weights = theta.tolist() if uniform else theta.reshape(n, n_weights).tolist()
    reference = ReferenceController(
        morphology.cells, model, n_c, directional, hidden, weights, as_printed
    )
    readings = draw_readings(rng, n_steps, n)
    total = 0.0
    for k in range(n_steps):
        actuation = np.array(controller.step(readings[k].copy()))
        assert actuation.shape == (n,)
        expected = reference.step(readings[k].tolist())
        outboxes = np.array(controller.cells.outbox)
        for i in range(n):
            theirs = (expected[i], reference.outboxes[i])
            assert_same(model, (actuation[i], outboxes[i]), theirs, f'cell {i} at {k}')
        total += np.abs(outboxes).sum()
        if model == 'mlp':
            # They agree to 1e-12; go on from the same messages, as the feedback through the
            # neighbours may amplify rounding without bound.
            reference.outboxes = [as_outbox(model, outbox) for outbox in outboxes]
    return total


@pytest.mark.parametrize('kind', ['uniform', 'normal'])
@pytest.mark.parametrize('model', MODELS)
@pytest.mark.parametrize('combination', COMBINATIONS)
def test_biped_with_the_papers_networks_is_the_reference(combination, model, kind):
    n_c = 1 if COMBINATIONS[combination][1] else 4
    biped = parse_morphology('biped')
    assert compare_controllers(biped, combination, model, n_c, None, kind, 9, 200) > 0


@pytest.mark.parametrize('model', SPIKING)
@pytest.mark.parametrize('combination', COMBINATIONS)
def test_biped_as_printed_is_the_reference(combination, model):
    n_c = 1 if COMBINATIONS[combination][1] else 3
    biped = parse_morphology('biped')
    total = compare_controllers(
        biped, combination, model, n_c, None, 'normal', 10, 200, as_printed=True
    )
    assert total > 0


@pytest.mark.parametrize('model', MODELS)
@pytest.mark.parametrize('combination', COMBINATIONS)
@dearest
@given(
    shape=st.sampled_from(['1', '11', '1-1', '101-111', '111-101-111', '010-111-010', '1101-0111']),
    n_c=st.integers(1, 3),
    hidden=st.sampled_from(HIDDEN),
    kind=st.sampled_from(WEIGHTS),
    as_printed=st.booleans(),
    seed=st.integers(0, 2**32 - 1),
)
def test_any_robot_is_the_reference(combination, model, shape, n_c, hidden, kind, as_printed, seed):
    compare_controllers(
        parse_morphology(shape),
        combination,
        model,
        n_c,
        hidden,
        kind,
        seed,
        200,
        as_printed=as_printed and model != 'mlp',
    )


@pytest.mark.parametrize('direction', DIRECTIONS)
def test_directed_message_is_heard_by_that_neighbor_one_step_later(direction):
    # No hidden layer, all weights 0, but: the bias of the message to `direction` (0.8), and the
    # weight (0.6) from what is heard from the opposite side to a.
    n_c, n_post = 1, 5
    weights = np.zeros(9 * n_post)
    weights[1 + DIRECTIONS.index(direction)] = 0.8
    heard_at = 4 + DIRECTIONS.index(OPPOSITE[direction])
    weights[(1 + heard_at) * n_post + 0] = 0.6
    heard = math.tanh(0.6 * math.tanh(math.tanh(0.8)))

    morphology = parse_morphology('111-111-111')
    dx, dy = {'above': (0, 1), 'left': (-1, 0), 'below': (0, -1), 'right': (1, 0)}[direction]
    has_sender = [(x - dx, y - dy) in morphology.cells for x, y in morphology.cells]
    expected = [heard if b else 0.0 for b in has_sender]
    assert sum(has_sender) == 6

    readings = np.full((9, 4), 0.5)
    reference = ReferenceController(morphology.cells, 'mlp', n_c, True, (), weights.tolist())
    architecture = make_architecture('U-D', 'mlp', n_c, ())
    controller = Controller(architecture, morphology, weights)
    controller.reset()
    for step in (lambda: reference.step(readings.tolist()), lambda: controller.step(readings)):
        assert list(step()) == pytest.approx([0.0] * 9, abs=1e-15)
        assert list(step()) == pytest.approx(expected, abs=1e-15)


def test_undirected_spikes_are_heard_by_all_four_neighbors_one_step_later():
    # A non-directional SNN without hidden layer: the only message spikes with sensor 0, and a
    # sums up the messages heard, each with weight 0.3: it takes four at once to reach 1.
    weights = np.zeros((8, 2))
    weights[0, 1] = 1.0
    weights[4:, 0] = 0.3
    morphology = parse_morphology('111-111-111')
    center = morphology.cells.index((1, 1))
    reference = ReferenceController(morphology.cells, 'snn', 1, False, (), weights.ravel().tolist())
    architecture = make_architecture('U-nD', 'snn', 1, ())
    controller = Controller(architecture, morphology, weights.ravel())
    controller.reset()
    readings = np.zeros((9, 4))  # a spike each 192 steps, 12 control steps
    for step in (lambda: reference.step(readings.tolist()), lambda: controller.step(readings)):
        found = np.array([step() for _ in range(12)])
        fired = found > -1
        assert np.all(np.delete(fired, center, axis=1) == 0)
        # Sent at k = 0, heard at k = 1, then in the window of 5 control steps.
        assert list(fired[:, center]) == [False] + [True] * 5 + [False] * 6


@pytest.mark.parametrize('model', MODELS)
def test_controller_starts_anew_after_reset(model):
    rng = np.random.default_rng(11)
    morphology = parse_morphology('biped')
    architecture = Architecture.named('nU-D', model)
    n = morphology.n_voxels
    theta = draw_weights(rng, 'normal', architecture.n_parameters(n))
    controller = Controller(architecture, morphology, theta)
    readings = draw_readings(rng, 60, n)
    runs = []
    for _ in range(2):
        controller.reset()
        runs.append(np.array([np.array(controller.step(r)) for r in readings]))
    np.testing.assert_array_equal(runs[0], runs[1])
