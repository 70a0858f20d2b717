"""What the project and the plain reference cell are both given, and how they are compared."""

import numpy as np
from hypothesis import settings
from support.reference_cell import (
    DIRECTIONS,
)

from snca_ros.cell.architecture import Architecture

MODELS = ('mlp', 'snn', 'snn-h')
SPIKING = ('snn', 'snn-h')
COMBINATIONS = {'U-nD': (True, False), 'U-D': (True, True), 'nU-D': (False, True)}
HIDDEN = (None, (), (1,), (3,), (7,), (5, 3), (3, 9))
WEIGHTS = ('uniform', 'normal', 'dyadic')
TOLERANCE = 1e-12
cheap = settings(max_examples=60)


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
