"""The description of one robot's graph, without ROS."""

from dataclasses import replace

import numpy as np
import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from sim_node.model.physics import PHYSICS
from sim_node.model.solver import Solver
from snca_ros.cell.architecture import Architecture
from snca_ros.graph.description import WalkOptions, choose_voxels, describe_graph
from snca_ros.trained_controller import TrainedController

BIPED = parse_morphology('biped')


@given(st.integers(1, 10))
def test_shares_partition_the_voxels(n):
    shares = [choose_voxels(BIPED, f'{k}/{n}') for k in range(1, n + 1)]
    assert sum(shares, ()) == BIPED.voxel_names
    assert {len(share) for share in shares} <= {10 // n, 10 // n + 1}


def test_named_voxels_are_sorted_and_unique():
    assert choose_voxels(BIPED, 'voxel_3_0,voxel_0_0,voxel_3_0') == ('voxel_0_0', 'voxel_3_0')
    assert choose_voxels(BIPED, 'none') == ()
    assert choose_voxels(BIPED, '') == BIPED.voxel_names


@pytest.mark.parametrize('only', ['0/2', '3/2', '1/11', '1/0', '1/2/3', 'voxel_1_0', 'left', ','])
def test_no_such_voxels(only):
    with pytest.raises(InvalidInput, match=r'only|voxel'):
        choose_voxels(BIPED, only)


@given(st.text(max_size=30) | st.text('0123456789/', max_size=12))
def test_any_text_chooses_voxels_or_is_refused(only):
    try:
        chosen = choose_voxels(BIPED, only)
    except InvalidInput:
        return
    assert set(chosen) <= set(BIPED.voxel_names)


@pytest.mark.parametrize('physics', PHYSICS)
@pytest.mark.parametrize('only', ['', '1/2', 'none'])
def test_the_simulation_gets_all_of_the_controllers_solver(tmp_path, physics, only):
    architecture = Architecture.named('U-nD', 'mlp')
    solver = Solver(2, 20, True, physics)
    trained = TrainedController(
        architecture, BIPED, np.zeros(architecture.n_parameters(10)), solver=solver
    )
    graph = describe_graph(tmp_path, trained, WalkOptions(only=only))
    nodes = yaml.safe_load(graph.parameters_yaml())
    given = nodes['/biped/sim_node']['ros__parameters']
    prefix = 'solver.'
    assert solver == Solver(**{
        name.removeprefix(prefix): value for name, value in given.items() if prefix in name
    })


def test_voxels_of_a_share_know_all_their_neighbours(tmp_path):
    architecture = Architecture.named('U-nD', 'mlp')
    trained = TrainedController(architecture, BIPED, np.zeros(architecture.n_parameters(10)))
    whole = describe_graph(tmp_path, trained, WalkOptions(bag='bag'))
    share = describe_graph(tmp_path, trained, WalkOptions(only='2/3', bag='bag'))
    assert [p.names for p in share.voxels] == [('voxel_1_1',), ('voxel_2_1',), ('voxel_3_1',)]
    for process in share.voxels:
        (same,) = [p for p in whole.voxels if p.names == process.names]
        assert process.parameters == same.parameters
    there = replace(share, simulation=None, recorder=None)
    assert there.processes == there.voxels
    assert 'sim_node' not in there.parameters_yaml()


@pytest.mark.parametrize(('controller', 'bag', 'field'), [
    ('c\udcff.npz', '', 'controller'), ('c.npz', 'b\udcff', 'bag'),
])
def test_a_path_that_no_ros_parameter_can_hold_is_refused(controller, bag, field):
    morphology, architecture = parse_morphology('11-10'), Architecture.named('U-nD', 'snn-h')
    trained = TrainedController(
        architecture, morphology, np.zeros(architecture.n_parameters(morphology.n_voxels))
    )
    with pytest.raises(InvalidInput, match=f'{field}: got .*udcff.*a path in UTF-8'):
        describe_graph(controller, trained, WalkOptions(bag=bag))


def test_all_nodes_get_the_reliability_of_the_links(tmp_path):
    architecture = Architecture.named('U-nD', 'mlp')
    trained = TrainedController(architecture, BIPED, np.zeros(architecture.n_parameters(10)))
    for reliability in ('reliable', 'best_effort'):
        options = WalkOptions(
            real_time_factor=1.0, bag=str(tmp_path / 'bag'), reliability=reliability
        )
        nodes = yaml.safe_load(describe_graph(tmp_path, trained, options).parameters_yaml())
        assert len(nodes) == 12
        for node in nodes.values():
            assert node['ros__parameters']['reliability'] == reliability
    with pytest.raises(InvalidInput, match=r"reliability: got 'best_effort'.*lock-step.*real time"):
        describe_graph(tmp_path, trained, WalkOptions(reliability='best_effort'))
    with pytest.raises(InvalidInput, match=r"reliability: got 'best-effort'.*best_effort"):
        WalkOptions(reliability='best-effort')
