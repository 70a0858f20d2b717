"""A graph uses its controller's physics; with another physics the voxels warn."""

import signal

import numpy as np
import pytest
from std_srvs.srv import Trigger
from support.graph import call, go, offline
from support.limits import LIMIT

from sim_node.model.morphology import DIRECTIONS, parse_morphology
from sim_node.model.physics import PHYSICS
from sim_node.model.solver import Solver
from snca_ros.controller_file import load_controller
from snca_ros.graph.description import WalkOptions, describe_graph
from snca_ros.graph.processes import RunningGraph
from snca_ros.recording.bag import read_bag
from snca_ros.recording.offline import record_offline

WARN = b'\x01'


@pytest.mark.parametrize('physics', PHYSICS)
def test_a_walk_has_the_physics_of_its_controller(make_controller, tmp_path, physics):
    path = make_controller(solver=Solver(physics=physics))
    trained = load_controller(path)
    options = WalkOptions(duration=1.5, voxels_per_process=2, bag=str(tmp_path / 'bag'))
    graph = describe_graph(path, trained, options)
    with RunningGraph(graph, {}) as running:
        assert running.wait(graph.simulation, LIMIT) == 0
    recording, (twin, _) = read_bag(tmp_path / 'bag'), record_offline(trained, path, 1.5)
    assert recording.physics == twin.physics == physics
    np.testing.assert_array_equal(recording.centers, twin.centers)
    np.testing.assert_array_equal(recording.readings, twin.readings)


def voxel_by_hand(voxel, path):
    """Return the arguments of a voxel node, as docs/graph.md has them."""
    morphology = parse_morphology('11-10')
    row = morphology.neighbors[morphology.index_of(voxel)]
    given = {'controller': path, **{
        f'neighbor.{d}': morphology.voxel_names[j]
        for d, j in zip(DIRECTIONS, row, strict=True) if j >= 0
    }}
    words = [word for name, value in given.items() for word in ('-p', f'{name}:={value}')]
    return ['voxel_node', voxel, '--ros-args', '-r', '__ns:=/robot', *words]


@pytest.mark.parametrize('physics', PHYSICS)
def test_a_simulation_by_hand_takes_its_physics_from_the_file(
    start, make_controller, tmp_path, physics
):
    path = make_controller(terrain='uphill-10', solver=Solver(physics=physics))
    recorder = start('recorder_node', '--ros-args', '-r', '__ns:=/robot',
                     '-p', f'bag:={tmp_path / "bag"}')
    simulation = start('sim_node', '--ros-args', '-r', '__ns:=/robot', '-p', 'recorders:=1',
                       '-p', f'controller:={path}', '-p', 'duration:=1.0')
    voxels = [start(*voxel_by_hand(v, path)) for v in parse_morphology('11-10').voxel_names]
    output, _ = simulation.communicate(timeout=LIMIT)
    assert simulation.returncode == 0, output
    for child in (*voxels, recorder):
        child.send_signal(signal.SIGINT)
        output, _ = child.communicate(timeout=LIMIT)
        assert 'was evolved in' not in output
    recording, (twin, _) = read_bag(tmp_path / 'bag'), record_offline(
        load_controller(path), path, 1.0
    )
    assert recording.physics == physics
    np.testing.assert_array_equal(recording.centers, twin.centers)


def test_a_voxel_in_another_physics_walks_on_and_warns_once_an_episode(
    walk, node, spin_until, centers, health
):
    _, children, path = walk(**{'solver.physics': 'first'})
    go(node, spin_until, centers)
    spin_until(lambda: 30 in centers[0])
    assert call(node, spin_until, Trigger, 'reset').success
    spin_until(lambda: len(centers) == 2 and 30 in centers[1])
    words = 'evolved in the physics reference, simulated in first'
    for voxel in ('voxel_0_0', 'voxel_0_1', 'voxel_1_1'):
        spin_until(lambda voxel=voxel: words in health[voxel][1])
        assert health[voxel][0] == WARN
    assert words not in health['sim_node'][1]
    children['voxel_0_0'].send_signal(signal.SIGINT)
    output, _ = children['voxel_0_0'].communicate(timeout=LIMIT)
    warnings = [line for line in output.splitlines() if 'was evolved in' in line]
    assert len(warnings) == 2, output  # two episodes
    for text in ('WARN', str(path), "'reference'", "'first'", f'-p controller:={path}',
                 '-p solver.physics:=reference'):
        assert text in warnings[0]


def test_voxels_of_the_same_physics_do_not_warn(walk, node, spin_until, centers, health):
    _, children, path = walk()
    go(node, spin_until, centers)
    spin_until(lambda: 60 in centers[0])
    np.testing.assert_array_equal([centers[0][k] for k in range(61)], offline(path, 1.0))
    children['voxel_0_0'].send_signal(signal.SIGINT)
    output, _ = children['voxel_0_0'].communicate(timeout=LIMIT)
    assert 'was evolved in' not in output
    assert 'evolved' not in health['voxel_0_0'][1]
