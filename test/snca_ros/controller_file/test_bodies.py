"""Controllers in other bodies, and in their own without some voxels."""

import contextlib

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.controller_files import assert_same, json_values, make, quick, refusal, write

from sim_node.errors import InvalidInput
from sim_node.model.body_file import load_body
from sim_node.model.morphology import parse_morphology
from snca_ros.controller_file import load_controller, save_controller


def weights(trained):
    """Return the rows of parameters that the cells use, by the voxel's name."""
    rows = trained.parameters.reshape(-1, trained.architecture.parameters_per_cell)
    n = trained.morphology.n_voxels
    return dict(zip(trained.morphology.voxel_names, np.resize(rows, (n, rows.shape[1])),
                    strict=True))


@pytest.mark.parametrize('body', ['tripod', '11-01', parse_morphology('comb-9x3')])
def test_a_uniform_controller_is_the_same_cell_in_any_body(body, path):
    trained = make('U-nD', 'snn-h', '11-10', fitness=2.5, scores={'pymunk': 2.5})
    other = trained.in_body(body)
    assert other.parameters is trained.parameters
    assert other.morphology == (parse_morphology(body) if isinstance(body, str) else body)
    assert other.home == trained.morphology
    assert other.simulation().morphology is other.morphology
    cells = other.controller().cells
    assert cells.state.outbox.shape[0] == other.morphology.n_voxels
    save_controller(path, other)
    assert_same(other, load_controller(path))
    assert load_body(path).morphology == other.morphology
    assert other.in_body('11-10').home is None
    assert_same(trained, other.in_body('11-10'))
    assert 'evolved as 11-10 on flat to v_x 2.500 m/s' in repr(other)
    assert 'evolved on flat to' in repr(trained)


def test_its_own_body_is_no_change():
    trained = make(shape='1111-1111-1001')
    for same in ('', 'biped', '1111-1111-1001', trained.morphology):
        assert trained.in_body(same) is trained
    for none in ('', (), []):
        assert trained.without(none) is trained


@pytest.mark.parametrize('name', ['U-D', 'nU-D'])
@pytest.mark.parametrize('gone', [['voxel_0_0'], ['voxel_1_1'], ['voxel_3_0', 'voxel_3_1']])
def test_the_cells_of_the_other_voxels_keep_their_parameters(name, gone, path):
    trained = make(name, shape='biped')
    damaged = trained.without(gone)
    assert damaged.home is trained.morphology
    assert damaged.morphology.missing_names == tuple(sorted(gone))
    before, after = weights(trained), weights(damaged)
    assert list(after) == [voxel for voxel in before if voxel not in gone]
    for voxel, row in after.items():
        np.testing.assert_array_equal(row, before[voxel])
    save_controller(path, damaged)
    again = load_controller(path)
    assert_same(damaged, again)
    assert again.morphology.voxel_names == tuple(after)
    more = again.without('voxel_2_1')
    assert more.home == trained.morphology
    np.testing.assert_array_equal(weights(more)['voxel_3_2'], before['voxel_3_2'])


def test_a_non_uniform_controller_fits_no_other_body():
    trained = make('nU-D', shape='11-10')
    for body in ('111', '11-01', '111-100', '11'):
        with pytest.raises(InvalidInput, match=r'shape: got .* expected 11-10, or less of it'):
            trained.in_body(body)
    assert trained.in_body('1x-10').parameters.shape == (2 * 117,)
    with pytest.raises(InvalidInput, match='shape: got'):
        trained.without('voxel_1_1').in_body('11-10')  # the parameters of voxel_1_1 are gone


@pytest.mark.parametrize(('call', 'text'), [
    (lambda c: c.in_body('bipd'), "morphology: got 'bipd', .*did you mean 'biped'"),
    (lambda c: c.without('voxel_5_5'), "voxel: got 'voxel_5_5', expected a voxel of 11-10"),
    (lambda c: c.without('voxel_0_1'), "without: got 'voxel_0_1', .* one connected piece"),
    (lambda c: c.without(c.morphology.voxel_names), 'without: got .* one connected piece'),
])
def test_bad_bodies_are_named(call, text):
    with pytest.raises(InvalidInput, match=text):
        call(make(shape='11-10'))


def test_a_wrong_home_is_named(path, header):
    good = {'name': 'biped', 'grid': '1111-1111-1001'}
    theta = make().parameters
    write(path, {**header, 'home': good}, theta)
    assert load_controller(path).home == parse_morphology('biped')
    for value, field in [
        (None, 'home'), ('biped', 'home'), ({}, 'home.name'), ({**good, 'name': 3}, 'home.name'),
        ({**good, 'grid': '101'}, 'home.grid'), ({'name': 'biped'}, 'home.grid'),
        ({**good, 'more': 1}, 'home'),
    ]:
        write(path, {**header, 'home': value}, theta)
        assert refusal(path).startswith(f'{field}: got ')


@quick
@given(value=json_values)
def test_any_home_is_taken_or_refused_by_name(tmp_path_factory, header, value):
    path = tmp_path_factory.mktemp('any') / 'any.npz'
    write(path, {**header, 'home': value}, make().parameters)
    assert refusal(path).startswith('home')


@quick
@given(st.integers(0, 2**10 - 1))
def test_any_damage_leaves_a_robot_or_is_refused(bits):
    trained = make('nU-D', shape='biped')
    names = trained.morphology.voxel_names
    gone = [name for i, name in enumerate(names) if bits >> i & 1]
    damaged = None
    with contextlib.suppress(InvalidInput):
        damaged = trained.without(gone)
    left = [(x, y) for x, y in trained.morphology.squares if f'voxel_{x}_{y}' not in gone]
    grid = [''.join('01'[(x, y) in left] for x in range(4)) for y in (2, 1, 0)]
    try:
        parse_morphology('-'.join(grid))
    except InvalidInput:
        assert damaged is None  # nothing left, or several pieces
        return
    assert damaged.morphology.n_voxels == len(names) - len(gone)
    n_parameters = damaged.architecture.n_parameters(damaged.morphology.n_voxels)
    assert damaged.parameters.shape == (n_parameters,)
