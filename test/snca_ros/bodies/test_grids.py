"""Grids as genomes: feet, which cells are possible, and mutations."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from snca_ros.bodies.grids import Frame, body_of, count_feet, mutated, random_body

FRAMES = st.builds(
    Frame, width=st.integers(1, 9), height=st.integers(1, 6), voxels=st.integers(1, 30)
)
STREAMS = st.integers(0, 2**32 - 1).map(np.random.default_rng)


@pytest.mark.parametrize(('grid', 'feet'), [
    ('1', 1), ('1111-1111', 1), ('1111-1001', 2), ('111-010', 1), ('11111-10101', 3),
    ('1111111-1011011', 3), ('comb', 4), ('biped', 2), ('tripod', 3), ('worm', 1),
])
def test_feet_are_runs_in_the_lowest_row(grid, feet):
    assert count_feet(parse_morphology(grid)) == feet


@pytest.mark.parametrize(('width', 'height', 'voxels'), [
    (1, 1, 1), (4, 1, 9), (1, 4, 3), (3, 2, 6), (3, 3, 5), (5, 2, 10), (3, 4, 12), (4, 3, 9),
])
def test_possible_cells_are_those_of_all_bodies(width, height, voxels):
    """Found by trying every grid of the rectangle."""
    found = set()
    for bits in itertools.product('01', repeat=width * height):
        rows = (''.join(bits[i : i + width]) for i in range(0, width * height, width))
        try:
            body = parse_morphology('-'.join(rows))
        except InvalidInput:  # empty or in pieces
            continue
        if body.n_voxels <= voxels:
            found.add((body.n_voxels, count_feet(body)))
    frame = Frame(width, height, voxels)
    assert set(frame.cells) == found
    assert frame.most_feet == max(feet for _, feet in found)


@given(frame=FRAMES, rng=STREAMS)
@settings(max_examples=60)
def test_random_and_mutated_bodies_are_possible(frame, rng):
    body = random_body(frame, rng)
    for _ in range(8):
        assert body.name == body.grid_string
        assert parse_morphology(body.grid_string) == body  # connected, in the corner
        assert frame.fits(body.squares)
        assert (body.n_voxels, count_feet(body)) in frame.cells
        body = mutated(body, frame, rng)


def test_mutations_reach_every_body_of_a_small_frame():
    frame, rng = Frame(3, 3, 9), np.random.default_rng(0)
    body = body_of([(0, 0)])
    found = {body.grid_string}
    for _ in range(20_000):
        body = mutated(body, frame, rng)
        found.add(body.grid_string)
    bodies = set()
    for bits in itertools.product('01', repeat=9):
        try:
            bodies.add(parse_morphology('-'.join(''.join(bits[i : i + 3]) for i in (0, 3, 6))))
        except InvalidInput:
            continue
    assert found == {body.grid_string for body in bodies}


def test_streams_of_one_seed_give_the_same_bodies():
    frame = Frame(6, 4, 15)
    bodies = []
    for seed in (1, 1, 2):
        rng = np.random.default_rng(seed)
        body = random_body(frame, rng)
        bodies.append([body := mutated(body, frame, rng) for _ in range(5)])
    assert bodies[0] == bodies[1] != bodies[2]
