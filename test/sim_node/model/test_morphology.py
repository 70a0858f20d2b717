import numpy as np
import pytest
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st

from sim_node.errors import InvalidInput
from sim_node.model.morphology import DIRECTIONS, OPPOSITE, SHAPES, Morphology, parse_morphology

steady = settings(suppress_health_check=[HealthCheck.filter_too_much])
grids = st.integers(1, 6).flatmap(
    lambda width: st.lists(
        st.text('01', min_size=width, max_size=width), min_size=1, max_size=6
    ).map('-'.join)
)
nearly_names = st.from_regex(r'(box|worm|biped|tripod|comb|t|ball|)-?[0-9x]{0,7}', fullmatch=True)


def occupied(grid):
    rows = grid.split('-')[::-1]
    return {(x, y) for y, row in enumerate(rows) for x, c in enumerate(row) if c == '1'}


def parsed(text):
    """Return (morphology, None) or (None, InvalidInput); other exceptions propagate."""
    try:
        return parse_morphology(text), None
    except InvalidInput as error:
        return None, error


def is_connected(cells):
    """Return whether the cells are connected, by label propagation."""
    label = {cell: i for i, cell in enumerate(sorted(cells))}
    before = None
    while before != label:
        before = dict(label)
        for x, y in label:
            near = ((x, y), (x + 1, y), (x - 1, y), (x, y + 1), (x, y - 1))
            label[x, y] = min(label[cell] for cell in near if cell in label)
    return set(label.values()) == {0}


@pytest.mark.parametrize(
    ('name', 'grid'),
    [
        ('biped', '1111-1111-1001'),
        ('biped-4x3', '1111-1111-1001'),
        ('biped-8x4', '11111111-11111111-11000011-11000011'),
        ('comb', '1111111-1010101'),
        ('comb-5x4', '11111-11111-10101-10101'),
        ('worm', '11111'),
        ('worm-2x1', '11'),
        ('box-2x3', '11-11-11'),
        ('tripod', '11111-11111-10101'),
        ('tripod-7x2', '1111111-1001001'),
        ('t-5x3', '11111-00100-00100'),
        ('t-4x2', '1111-0110'),
        ('ball-1', '1'),
        ('ball-3', '111-111-111'),
        ('ball-5', '01110-11111-11111-11111-01110'),
        ('1', '1'),
        ('1111-1111-1001', '1111-1111-1001'),
    ],
)
def test_shapes_of_paper_and_reference(name, grid):
    morphology = parse_morphology(name)
    assert morphology.grid_string == grid
    assert morphology.name == name
    assert morphology.n_voxels == grid.count('1')
    assert (morphology.width, morphology.height) == (grid.find('-') % (len(grid) + 1),
                                                     grid.count('-') + 1)


def test_voxels_are_indexed_row_by_row_from_the_bottom():
    biped = parse_morphology('biped')
    assert biped.squares == (
        (0, 0), (3, 0), (0, 1), (1, 1), (2, 1), (3, 1), (0, 2), (1, 2), (2, 2), (3, 2),
    )
    assert biped.voxel_names[1] == 'voxel_3_0'
    assert biped.voxel_names[-1] == 'voxel_3_2'


def test_neighbors_of_the_biped_by_hand():
    assert DIRECTIONS == ('above', 'left', 'below', 'right')
    table = parse_morphology('biped').neighbors
    assert table.dtype == np.int64
    assert table.tolist() == [
        [2, -1, -1, -1], [5, -1, -1, -1],
        [6, -1, 0, 3], [7, 2, -1, 4], [8, 3, -1, 5], [9, 4, 1, -1],
        [-1, -1, 2, 7], [-1, 6, 3, 8], [-1, 7, 4, 9], [-1, 8, 5, -1],
    ]


@steady
@given(grids)
def test_any_grid_is_parsed_exactly_when_it_is_connected(grid):
    cells = occupied(grid)
    if not is_connected(cells):
        with pytest.raises(InvalidInput):
            parse_morphology(grid)
        return
    morphology = parse_morphology(grid)
    x0, y0 = min(x for x, _ in cells), min(y for _, y in cells)
    assert set(morphology.squares) == {(x - x0, y - y0) for x, y in cells}
    assert len(morphology.squares) == len(cells)
    again = parse_morphology(morphology.grid_string)
    assert again.same_shape(morphology)
    assert again.grid_string == morphology.grid_string


@steady
@given(grids)
def test_neighbors_are_mutual(grid):
    assume(is_connected(occupied(grid)))
    morphology = parse_morphology(grid)
    cells, table = morphology.squares, morphology.neighbors
    for i, cell in enumerate(cells):
        for d, (dx, dy) in enumerate(((0, 1), (-1, 0), (0, -1), (1, 0))):
            other = (cell[0] + dx, cell[1] + dy)
            assert (table[i, d] >= 0) == (other in cells)
            if table[i, d] >= 0:
                assert cells[table[i, d]] == other
                assert table[table[i, d], OPPOSITE[d]] == i


@steady
@given(st.one_of(st.text(max_size=30), st.text('01x-', max_size=30), nearly_names))
def test_any_string_is_a_morphology_or_invalid_input(text):
    morphology, error = parsed(text)
    if error:
        assert error.field == 'morphology'
        assert '\n' not in str(error)
    else:
        assert 1 <= morphology.n_voxels <= 64 * 64
        assert len(set(morphology.squares)) == morphology.n_voxels
        corner = (min(numbers) for numbers in zip(*morphology.complete, strict=True))
        assert tuple(corner) == (0, 0)


@pytest.mark.parametrize('shape', SHAPES)
@pytest.mark.parametrize('size', [1, 2, 3, 4, 7, 9])
def test_generators_of_any_size_give_one_connected_piece_or_invalid_input(shape, size):
    text = f'ball-{size}' if shape == 'ball' else f'{shape}-{size}x{size}'
    assert is_connected(set(parse_morphology(text).squares))


def test_empty_border_of_a_grid_is_ignored():
    assert parse_morphology('0000-0110-0010-0000').grid_string == '11-01'


@pytest.mark.parametrize(
    'text',
    [
        '', '-', '1-', '-1', '0', '00-00', 'x', 'xx-0x', '1x1', '1-x-1', '1X', '11-1',
        '101', '10-01', '1' * 65, '-'.join('1' * 65),
        'biped-', 'biped-4', 'biped-0x3', 'biped-65x1', 'biped-4x3x2', 'box', 'ball', 'ball-0',
        'ball-65', 'ball-3x3', 'wurm', 'Biped', ' biped', '1\n', '١', 'comb-٧x2', None, 5, b'biped',
    ],
)
def test_invalid_morphologies_are_rejected(text):
    with pytest.raises(InvalidInput):
        parse_morphology(text)


def test_the_error_names_the_value_and_the_closest_name():
    with pytest.raises(InvalidInput, match=r"morphology: got 'bipet', expected .*'biped'"):
        parse_morphology('bipet')


def test_index_of():
    biped = parse_morphology('biped')
    assert biped.index_of('voxel_3_0') == 1
    for name in ('voxel_1_0', 'voxel_3', ''):
        with pytest.raises(InvalidInput, match='voxel'):
            biped.index_of(name)


@steady
@given(grids, st.data())
def test_a_damaged_body_keeps_the_names_of_the_others(grid, data):
    assume(is_connected(occupied(grid)))
    whole = parse_morphology(grid)
    gone = data.draw(st.lists(st.sampled_from(whole.voxel_names), unique=True))
    left = [(x, y) for x, y in whole.squares if f'voxel_{x}_{y}' not in gone]
    if not left or not is_connected(set(left)):
        with pytest.raises(InvalidInput, match=r'without: .* one connected piece'):
            whole.without(gone)
        return
    for damaged in (whole.without(gone), whole.without(','.join(gone))):
        assert damaged.squares == tuple(left)
        assert set(damaged.missing_names) == set(gone)
        assert damaged.complete == whole.squares
        assert (damaged.width, damaged.height) == (whole.width, whole.height)
        assert damaged.grid_string.replace('x', '1') == whole.grid_string
        again = parse_morphology(damaged.grid_string)
        assert (again.squares, again.missing) == (damaged.squares, damaged.missing)


def test_missing_voxels_by_hand():
    damaged = parse_morphology('biped').without('voxel_3_0,voxel_0_0')
    assert damaged.grid_string == '1111-1111-x00x'
    assert damaged.voxel_names[0] == 'voxel_0_1'
    assert damaged.label == 'biped without voxel_0_0, voxel_3_0'
    assert damaged.neighbors[0].tolist() == [4, -1, -1, 1]
    assert damaged.without(['voxel_0_1']).missing_names == ('voxel_0_0', 'voxel_3_0', 'voxel_0_1')
    assert parse_morphology('00x1-0011').squares == ((0, 0), (1, 0), (1, 1))
    assert parse_morphology('0x01-0011').squares == ((1, 0), (2, 0), (2, 1))
    assert parse_morphology('biped').without('') == parse_morphology('biped')
    with pytest.raises(InvalidInput, match="voxel: got 'voxel_3_0', expected a voxel of biped"):
        damaged.without('voxel_3_0')


def test_same_shape_ignores_the_name():
    biped = parse_morphology('biped')
    assert biped.same_shape(parse_morphology('1111-1111-1001'))
    assert not biped.same_shape(parse_morphology('1111-1111-1010'))
    assert biped != Morphology('other', biped.squares)


@pytest.mark.parametrize(('name', 'expected'), [
    ('biped', "Morphology('biped', 10 voxels, '1111-1111-1001')"),
    ('11-10', "Morphology('11-10', 3 voxels, '11-10')"),
    ('1', "Morphology('1', 1 voxel, '1')"),
])
def test_repr_is_short_and_equality_compares_name_and_cells(name, expected):
    morphology = parse_morphology(name)
    assert repr(morphology) == str(morphology) == expected
    assert morphology == parse_morphology(name)
    assert hash(morphology) == hash(parse_morphology(name))
    assert morphology != Morphology('other', morphology.squares)
    assert morphology != Morphology(morphology.name, ((0, 0), (1, 0)))
