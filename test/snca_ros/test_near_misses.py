"""Every name that a person may mistype is refused with the one that was almost written."""

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sim_node.engine import check_engine
from sim_node.errors import InvalidInput, check_name, near_miss
from sim_node.model.body_faults import parse_breakage
from sim_node.model.material import Material
from sim_node.model.morphology import parse_morphology
from sim_node.model.solver import Solver
from sim_node.model.terrain import parse_terrain
from snca_ros.bundled import find_controller
from snca_ros.campaign.specification import read_campaign
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.strategies import STRATEGIES
from snca_ros.faults import parse_faults

CELL = {'uniform': True, 'directional': False, 'neuron_model': 'snn'}


@pytest.mark.parametrize(('read', 'meant'), [
    (lambda: parse_morphology('bipd-4x3'), 'biped'),
    (lambda: parse_morphology('biped').index_of('voxl_0_0'), 'voxel_0_0'),
    (lambda: parse_terrain('stepy-1-10-0'), 'steppy'),
    (lambda: check_engine('bached', Solver()), 'batched'),
    (lambda: STRATEGIES.find('cms'), 'cma'),
    (lambda: Architecture.named('U-ND', 'snn'), 'U-nD'),
    (lambda: Architecture.named('U-nD', 'snnh'), 'snn-h'),
    (lambda: find_controller('biped-U-nD-snnh'), 'biped-U-nD-snn-h'),
    (lambda: parse_faults('los=0.3'), 'loss'),
    (lambda: parse_breakage('broken_sensors', 'frosen:0.5'), 'frozen'),
    (lambda: Material.from_dict({'gravty': 9.8}), 'gravity'),
    (lambda: Solver.from_dict({'substep': 2}), 'substeps'),
    (lambda: RunConfig.from_dict({'shape': 'biped', 'architecture': CELL, 'sed': 1}), 'seed'),
])
def test_the_name_that_was_meant_is_told(read, meant):
    with pytest.raises(InvalidInput) as error:
        read()
    assert f"(did you mean '{meant}'?)" in str(error.value)


@pytest.mark.parametrize(('values', 'meant'), [
    ({'shpe': 'biped'}, 'shape'),
    ({'cases': [{'architekture': 'U-nD'}]}, 'architecture'),
])
def test_keys_of_a_yaml_file(values, meant, tmp_path):
    path = tmp_path / 'campaign.yaml'
    path.write_text(yaml.safe_dump(values))
    with pytest.raises(InvalidInput) as error:
        read_campaign(path)
    assert f"(did you mean '{meant}'?)" in str(error.value)
    assert str(path) in str(error.value)


@given(st.text(max_size=30) | st.integers() | st.none() | st.lists(st.integers()))
def test_any_value_is_a_name_or_refused(value):
    known = ('pymunk', 'batched')
    if value in known:
        check_name('engine', value, known)
    else:
        with pytest.raises(InvalidInput, match=r'engine: got .* one of pymunk, batched'):
            check_name('engine', value, known)


def test_what_is_far_from_all_names_has_no_hint():
    assert near_miss('xyzzy', ('biped', 'comb')) == ''
    assert near_miss('BIPED', ('biped', 'comb')) == " (did you mean 'biped'?)"
