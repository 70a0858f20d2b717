"""The options --shape and --without: the controller in a body, and the file that nodes load."""

import tempfile
from contextlib import ExitStack

import pytest
from support.controller_files import assert_same, make

from sim_node.errors import InvalidInput
from snca_ros.commands.body_options import load_in_body
from snca_ros.controller_file import load_controller, save_controller


@pytest.fixture
def path(tmp_path, monkeypatch):
    """Return a controller file; temporary files are made in a folder beside it."""
    (tmp_path / 'temporary').mkdir()
    monkeypatch.setattr(tempfile, 'tempdir', str(tmp_path / 'temporary'))
    save_controller(tmp_path / 'mine.npz', make(shape='11-10'))
    return tmp_path / 'mine.npz'


def test_the_own_body_needs_no_other_file(path):
    with ExitStack() as stack:
        for shape in ('', '11-10'):
            file, trained = load_in_body(path, shape, '', stack)
            assert file == path
            assert_same(trained, load_controller(path))


@pytest.mark.parametrize(('shape', 'without', 'grid'), [
    ('111-101', '', '111-101'), ('', 'voxel_0_0', '11-x0'),
    ('111-101', 'voxel_0_0,voxel_1_1,voxel_0_1', 'xx1-x01'),
])
def test_nodes_load_a_temporary_file_of_another_body(path, shape, without, grid):
    with ExitStack() as stack:
        file, trained = load_in_body(path, shape, without, stack)
        assert trained.morphology.grid_string == grid
        assert (file.name, file.parent.parent.name) == ('mine.npz', 'temporary')
        assert_same(trained, load_controller(file))
    assert list((path.parent / 'temporary').iterdir()) == []
    assert_same(make(shape='11-10'), load_controller(path))


def test_a_bad_body_leaves_no_file(path):
    for shape, without in (('bipd', ''), ('', 'voxel_1_0'), ('111', 'voxel_1_0')):
        with ExitStack() as stack, pytest.raises(InvalidInput):
            load_in_body(path, shape, without, stack)
    assert list((path.parent / 'temporary').iterdir()) == []
