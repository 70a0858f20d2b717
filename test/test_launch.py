"""launch/robot.launch.py with stand-ins for launch and launch_ros, which PyPI does not have."""

import os
import shutil
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest
import yaml
from support.stand_in_launch import defaults, describe, stand_ins

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import load_controller, save_controller
from snca_ros.faults import Faults
from snca_ros.graph.child_process import PARENT
from snca_ros.graph.description import WalkOptions, describe_graph
from snca_ros.trained_controller import TrainedController


@pytest.fixture
def description(monkeypatch):
    """Return what the launch file describes."""
    for name, module in stand_ins().items():
        monkeypatch.setitem(sys.modules, name, module)
    return describe()


@pytest.fixture
def temporary(monkeypatch, tmp_path):
    """Return the folder in which temporary files are made."""
    folder = tmp_path / 'temporary'
    folder.mkdir()
    monkeypatch.setattr(tempfile, 'tempdir', str(folder))
    return folder


@pytest.fixture
def controller(tmp_path):
    """Return a controller file of three voxels."""
    morphology, architecture = parse_morphology('11-10'), Architecture.named('U-nD', 'snn-h')
    theta = np.zeros(architecture.n_parameters(3))
    save_controller(tmp_path / 'c.npz', TrainedController(architecture, morphology, theta))
    return tmp_path / 'c.npz'


@pytest.fixture
def launch(description, temporary, controller):
    """Return a function that launches with some arguments given: (clean-up, nodes)."""
    *_, opaque = description.arguments[0]

    def run(**given):
        assert set(given) <= set(defaults(description))
        context = {**defaults(description), 'controller': str(controller), **given}
        handler, *nodes = opaque.named['function'](context)
        assert type(handler).__name__ == 'RegisterEventHandler'
        assert {type(node).__name__ for node in nodes} == {'Node'}
        return handler.arguments[0].named['on_shutdown'], [node.named for node in nodes]

    return run


def params_of(nodes):
    (path,) = {path for node in nodes for path in node['parameters']}
    return Path(path)


def ends_the_launch(nodes):
    return [n['executable'] for n in nodes if type(n['on_exit']).__name__ == 'Shutdown']


def test_every_argument_is_declared_as_text_with_a_description(description):
    *declared, opaque = description.arguments[0]
    assert type(opaque).__name__ == 'OpaqueFunction'
    assert [a.arguments[0] for a in declared] == [
        'controller', 'shape', 'without', 'robot', 'terrain', 'duration', 'real_time_factor',
        'reliability',
        'voxels_per_process', 'bag', 'storage', 'faults',
    ]
    for argument in declared:
        assert isinstance(argument.named['default_value'], str)
        assert argument.named['description']


def test_a_process_for_the_simulation_and_one_for_each_voxel(launch):
    _, nodes = launch()
    assert [(n['executable'], n['arguments']) for n in nodes] == [
        ('sim_node', []), ('voxel_node', ['voxel_0_0']), ('voxel_node', ['voxel_0_1']),
        ('voxel_node', ['voxel_1_1']),
    ]
    for node in nodes:
        assert (node['package'], node['namespace']) == ('snca_ros', '/robot_11_10')
        assert node['output'] == 'screen'
        assert node['additional_env'] == {PARENT: str(os.getpid())}
    assert [n['ros_arguments'] for n in nodes] == [
        ['--enclave', f'/robot_11_10/{name}']
        for name in ('sim_node', 'voxel_0_0', 'voxel_0_1', 'voxel_1_1')
    ]
    assert ends_the_launch(nodes) == ['sim_node']
    assert [n['on_exit'] for n in nodes[1:]] == [None] * 3


def test_parameters_are_those_of_walk(launch, controller, tmp_path):
    _, nodes = launch(
        robot='duck', terrain='hilly-1-10-0', duration='2.5', real_time_factor='0.5',
        reliability='best_effort', voxels_per_process='2', bag=str(tmp_path / 'bag'),
        storage='sqlite3', faults='loss=0.25,seed=3',
    )
    options = WalkOptions(
        robot='duck', terrain='hilly-1-10-0', duration=2.5, real_time_factor=0.5,
        reliability='best_effort', voxels_per_process=2, bag=str(tmp_path / 'bag'),
        storage='sqlite3', faults=Faults(loss=0.25, seed=3),
    )
    graph = describe_graph(controller, load_controller(controller), options)
    given = yaml.safe_load(params_of(nodes).read_text())
    assert given == yaml.safe_load(graph.parameters_yaml())
    assert given['/duck/sim_node']['ros__parameters']['duration'] == 2.5
    assert given['/duck/voxel_0_0']['ros__parameters']['loss'] == 0.25
    assert [n['executable'] for n in nodes] == [
        'recorder_node', 'sim_node', 'voxel_node', 'voxel_node',
    ]
    assert [len(n['arguments']) for n in nodes] == [0, 0, 2, 1]
    assert {n['namespace'] for n in nodes} == {'/duck'}
    assert ends_the_launch(nodes) == ['recorder_node', 'sim_node']


def test_nodes_load_the_controller_in_its_other_body(launch, temporary):
    clean_up, nodes = launch(shape='111', without='voxel_0_0')
    given = yaml.safe_load(params_of(nodes).read_text())
    assert [n['arguments'] for n in nodes[1:]] == [['voxel_1_0'], ['voxel_2_0']]
    assert given['/robot_111/sim_node']['ros__parameters']['morphology'] == 'x11'
    path = given['/robot_111/voxel_1_0']['ros__parameters']['controller']
    trained = load_controller(path)
    assert (trained.morphology.grid_string, trained.home.grid_string) == ('x11', '11-10')
    clean_up('event', 'context')
    assert list(temporary.iterdir()) == []


def test_defaults_are_the_bundled_biped_for_half_a_minute(description, temporary):
    *_, opaque = description.arguments[0]
    _, *nodes = opaque.named['function'](defaults(description))
    given = yaml.safe_load(params_of([n.named for n in nodes]).read_text())
    simulation = given['/biped/sim_node']['ros__parameters']
    assert (len(given), simulation['duration']) == (11, 30.0)
    assert (simulation['real_time_factor'], simulation['recorders']) == (0.0, 0)


def test_folder_of_the_params_file_goes_with_the_launch(launch, temporary):
    clean_up, nodes = launch()
    folder = params_of(nodes).parent
    assert list(temporary.iterdir()) == [folder]
    clean_up('event', 'context')
    assert list(temporary.iterdir()) == []
    clean_up('event', 'context')


def test_somebody_else_may_have_cleaned_up(launch):
    clean_up, nodes = launch()
    shutil.rmtree(params_of(nodes).parent)
    clean_up('event', 'context')


@pytest.mark.parametrize(('name', 'value', 'complaint'), [
    ('controller', 'bipet', "controller: got 'bipet', .* one of biped-U-D-mlp"),
    ('duration', 'long', r"duration: got 'long', expected a number from 0 to 100000 \[s\]"),
    ('real_time_factor', '', "real_time_factor: got '', expected a number from 0 to 100"),
    ('voxels_per_process', '1.5', "voxels_per_process: got '1.5', expected an integer from 1"),
    ('voxels_per_process', '0', 'voxels_per_process: got 0, expected an integer from 1 to 1000'),
    ('robot', 'a b', "robot: got 'a b', expected letters"),
    ('faults', 'los=0.3', "faults: got 'los', .*did you mean 'loss'"),
    ('faults', 'loss=2', 'loss: got 2.0, expected a number from 0 to 1'),
    ('faults', 'nowhere.yaml', 'nowhere.yaml'),
    ('faults', 'death=voxel_9_9', "death: voxel: got 'voxel_9_9', expected"),
    ('faults', 'broken_sensors=zero:voxel_9_9', "broken_sensors: voxel: got 'voxel_9_9', expected"),
    ('shape', 'bipd', "morphology: got 'bipd', .*did you mean 'biped'"),
    ('without', 'voxel_0_1', "without: got 'voxel_0_1', expected voxels of 11-10 without which"),
    ('without', 'voxel_9_9', "voxel: got 'voxel_9_9', expected"),
    ('terrain', 'hily-1-10-0', "terrain: got 'hily-1-10-0', .*did you mean 'hilly'"),
    ('duration', '-1', 'duration: got -1.0, expected a number from 0 to 100000'),
    ('duration', 'nan', 'duration: got nan, expected a number from 0 to 100000'),
    ('storage', 'mcaps', "storage: got 'mcaps', .*did you mean 'mcap'"),
    ('bag', '.', "bag: got '.', expected a folder that does not exist yet"),
    ('bag', '/proc/none/bag', "bag: got '/proc/none/bag', expected a folder that can be written"),
])
def test_bad_arguments_are_named_and_leave_nothing(launch, temporary, name, value, complaint):
    with pytest.raises(InvalidInput, match=complaint):
        launch(**{name: value})
    assert list(temporary.iterdir()) == []
