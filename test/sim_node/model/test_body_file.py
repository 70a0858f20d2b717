"""The body's part of a controller file, read without the cells.

What else damaged files are refused for is in test/snca_ros/controller_file/, which reads
the same part.
"""

import json
import subprocess
import sys

import numpy as np
import pytest

from sim_node.errors import InvalidInput
from sim_node.model.body_file import load_body
from sim_node.model.material import Material
from sim_node.model.solver import Solver

HEADER = {
    'format_version': 1,
    'morphology': {'name': 'duo', 'grid': '11'},
    'terrain': 'hilly-1-10-0',
    'material': {'gravity': 1.6},
    'solver': {'substeps': 2, 'physics': 'reference'},
    'chosen_by': 'batched',
}


def write(path, **changes):
    header = {key: value for key, value in {**HEADER, **changes}.items() if value is not None}
    np.savez(path, header=np.array(json.dumps(header)))
    return path


def test_all_that_it_says(tmp_path):
    body = load_body(write(tmp_path / 'a.npz'))
    assert (body.morphology.name, body.morphology.grid_string) == ('duo', '11')
    assert body.terrain == 'hilly-1-10-0'
    assert body.material == Material(gravity=1.6)
    assert body.solver == Solver(substeps=2, physics='reference')


def test_a_file_from_before_physics_and_engines_had_names(tmp_path):
    body = load_body(write(tmp_path / 'a.npz', solver={'substeps': 2}, chosen_by=None))
    assert body.solver.physics == 'first'


@pytest.mark.parametrize(('changes', 'expected'), [
    ({'format_version': 3}, r'format_version: got 3, expected 1 or 2'),
    ({'morphology': {'name': 'duo', 'grid': '101'}}, 'morphology'),
    ({'terrain': None}, 'terrain: got None'),
    ({'material': {'gravity': -1.0}}, r'material\.gravity: got -1\.0'),
    ({'solver': {'physics': 'frist'}}, r"solver\.physics: got 'frist', .*\(did you mean 'first'"),
])
def test_what_is_off_is_named_with_its_file(tmp_path, changes, expected):
    path = write(tmp_path / 'a.npz', **changes)
    with pytest.raises(InvalidInput, match=expected) as caught:
        load_body(path)
    assert str(caught.value).startswith(f'{path}: ')


def test_no_file(tmp_path):
    with pytest.raises(InvalidInput, match=r'a\.npz: file: got .No such file'):
        load_body(tmp_path / 'a.npz')


def test_it_needs_nothing_of_the_cells():
    loaded = subprocess.run(
        [sys.executable, '-c', 'import sys, sim_node.model.body_file; print(*sys.modules)'],
        check=True, capture_output=True, text=True,
    ).stdout.split()
    assert not [name for name in loaded if name.partition('.')[0] == 'snca_ros']
