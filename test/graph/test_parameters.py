"""Node parameters: every value is either used as given or refused with the parameter's name."""

import itertools
import json

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.parameter import Parameter

from sim_node.errors import InvalidInput
from sim_node.model.material import Material
from sim_node.model.morphology import parse_morphology
from sim_node.model.solver import Solver
from sim_node.ros.declared_parameters import check_unknown_parameters
from sim_node.ros.node_base import RosNode
from sim_node.ros.parameters import simulation_of
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import save_controller
from snca_ros.trained_controller import TrainedController

VALUES = (
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats() | st.text(max_size=30)
    | st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1, max_size=3)
    | st.lists(st.floats(), min_size=1, max_size=3)
    | st.lists(st.text(max_size=9), min_size=1, max_size=3)
    | st.lists(st.booleans(), min_size=1, max_size=3)
)
DEFAULTS = {'text': ('flat',), 'number': (1.0, 0.0, 10.0), 'count': (1, 0, 10), 'flag': (False,)}


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=st.sampled_from(sorted(DEFAULTS)), value=VALUES)
def test_any_value_is_taken_or_refused_by_name(ros, name, value):
    node = RosNode('any', parameter_overrides=[Parameter(name, value=value)])
    default, *bounds = DEFAULTS[name]
    taken, complaint = default, ''
    try:
        taken = node.parameter(name, default, 'what it is', *bounds)
    except InvalidInput as error:
        complaint = str(error)
    finally:
        node.destroy_node()
    assert not complaint or complaint.startswith(f'/any: {name}: got ')
    assert '\n' not in complaint
    assert type(taken) is type(default)
    assert not bounds or bounds[0] <= taken <= bounds[1]


@pytest.mark.parametrize('name', ['durration', 'material.', 'a' * 200])
def test_unknown_parameters_are_refused(ros, name):
    node = RosNode('any', parameter_overrides=[Parameter(name, value=1.0)])
    node.parameter('duration', 1.0, 'what it is')
    with pytest.raises(InvalidInput, match='parameter'):
        check_unknown_parameters(node)
    node.destroy_node()


def test_a_parameter_of_any_type_keeps_what_is_given(ros):
    for default, value in itertools.product((False, 'all'), (True, False, 'reference', 3, 2.5)):
        node = RosNode('any', parameter_overrides=[Parameter('kind', value=value)])
        taken = node.parameter('kind', default, 'what it is', any_type=True)
        node.destroy_node()
        assert type(taken) is type(value)
        assert taken == value


@pytest.fixture
def simulation(ros):
    """Return a function that makes the simulation of a node with these parameters."""

    def make(**given):
        names = {name.replace('__', '.'): value for name, value in given.items()}
        node = RosNode('sim_node', parameter_overrides=[
            Parameter(name, value=value) for name, value in names.items()
        ])
        try:
            found = simulation_of(node)
            check_unknown_parameters(node)
        finally:
            node.destroy_node()
        return found

    return make


@pytest.fixture(params=['first', 'reference'])
def trained(request, tmp_path):
    """Return a controller whose body has no default parameters, and its file."""
    architecture, morphology = Architecture.named('U-nD', 'mlp'), parse_morphology('11-10')
    trained = TrainedController(
        architecture, morphology, np.zeros(architecture.n_parameters(3)),
        terrain='hilly-1-10-0', material=Material(gravity=9, friction=0.5),
        solver=Solver(2, 20, physics=request.param), chosen_by='batched',
    )
    save_controller(tmp_path / 'c.npz', trained)
    return trained, str(tmp_path / 'c.npz')


def test_without_a_controller_all_is_default(simulation):
    found = simulation()
    assert found.morphology.same_shape(parse_morphology('biped'))
    assert (found.terrain.name, found.engine) == ('flat', 'pymunk')
    assert (found.material, found.solver) == (Material(), Solver(physics='reference'))


def test_a_controller_gives_all_of_body_and_world(simulation, trained):
    controller, path = trained
    found = simulation(controller=path)
    assert found.morphology.grid_string == controller.morphology.grid_string
    assert (found.terrain.name, found.engine) == ('hilly-1-10-0', 'pymunk')
    assert (found.material, found.solver) == (controller.material, controller.solver)


def test_given_parameters_override_the_controller(simulation, trained):
    _, path = trained
    found = simulation(
        controller=path, morphology='111', terrain='flat', engine='pymunk', material__gravity=1.6,
        solver__substeps=1, solver__self_collision=True, solver__physics='reference',
    )
    assert found.morphology.grid_string == '111'
    assert (found.terrain.name, found.engine) == ('flat', 'pymunk')
    assert found.material == Material(gravity=1.6, friction=0.5)
    assert found.solver == Solver(1, 20, True, 'reference')


def test_a_controller_that_names_no_physics_has_the_first(simulation, trained, tmp_path):
    _, path = trained
    with np.load(path) as data:
        header, theta = json.loads(data['header'].item()), data['theta']
    del header['solver']['physics']
    np.savez(tmp_path / 'old.npz', header=np.array(json.dumps(header)), theta=theta)
    assert simulation(controller=str(tmp_path / 'old.npz')).solver == Solver(2, 20, physics='first')


def test_the_solver_defines_the_range_of_self_collision(simulation):
    assert simulation(solver__self_collision=True).solver.self_collision is True
    for value in ('yes', 1, ''):
        with pytest.raises(InvalidInput, match=r'/sim_node: solver\.self_collision: got'):
            simulation(solver__self_collision=value)
