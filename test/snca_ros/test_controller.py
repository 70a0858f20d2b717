"""Whole robots against the reference controller: spikes exactly, values to 1e-12."""

import math

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
    as_outbox,
    assert_same,
    draw_readings,
    draw_weights,
    make_architecture,
)
from support.reference_cell import (
    DIRECTIONS,
    OPPOSITE,
    ReferenceController,
    n_weights_of,
    sizes_of,
)

from sim_node.model.morphology import parse_morphology
from snca_ros.cell.architecture import Architecture
from snca_ros.controller import Controller

dearest = settings(max_examples=5)


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
        morphology.squares, model, n_c, directional, hidden, weights, as_printed
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
    has_sender = [(x - dx, y - dy) in morphology.squares for x, y in morphology.squares]
    expected = [heard if b else 0.0 for b in has_sender]
    assert sum(has_sender) == 6

    readings = np.full((9, 4), 0.5)
    reference = ReferenceController(morphology.squares, 'mlp', n_c, True, (), weights.tolist())
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
    center = morphology.squares.index((1, 1))
    squares, flat = morphology.squares, weights.ravel()
    reference = ReferenceController(squares, 'snn', 1, False, (), flat.tolist())
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
