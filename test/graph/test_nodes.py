"""Every node ends cleanly on a signal, and reports invalid input in one line."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from support.limits import LIMIT
from support.paths import ROOT
from support.processes import is_alive, wait_until

from snca_ros.bundled import DEFAULT_CONTROLLER, find_controller
from snca_ros.controller_file import load_controller
from snca_ros.graph.description import WalkOptions, describe_graph

READY = {
    'sim_node': 'sensors', 'voxel_node': 'actuation', 'recorder_node': 'parameter_events',
}


def arguments(executable, controller, tmp_path):
    given = {
        'sim_node': ['-p', 'morphology:=11-10'],
        'voxel_node': ['-p', f'controller:={controller}'],
        'recorder_node': ['-p', f'bag:={tmp_path / "bag"}'],
    }[executable]
    return [executable, '--ros-args', '-r', '__ns:=/robot', *given]


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize('executable', READY)
def test_ends_cleanly(start, node, spin_until, make_controller, tmp_path, executable, number):
    child = start(*arguments(executable, make_controller(), tmp_path), real=True)
    name = 'voxel_0_0' if executable == 'voxel_node' else executable
    spin_until(lambda: (name, '/robot') in node.get_node_names_and_namespaces())
    child.send_signal(number)
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0, output
    assert 'Traceback' not in output
    assert 'error' not in output.lower()


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGTERM])
def test_ends_cleanly_while_starting(start, make_controller, tmp_path, number):
    child = start(*arguments('voxel_node', make_controller(), tmp_path), real=True)
    child.send_signal(number)  # Python itself may still be starting: then the signal's own code
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode in (0, 130, -number), output
    assert 'rclpy' not in output


def test_nodes_end_with_their_launch(make_controller, tmp_path):
    """`ros2 launch` does not end its processes when it is terminated."""
    bag = tmp_path / 'bag'
    launch = subprocess.Popen(
        [sys.executable, '-m', 'support.stand_in_launch', f'controller:={make_controller()}',
         'duration:=0.0', f'bag:={bag}'],
        env={**os.environ, 'PYTHONPATH': f'{ROOT}{os.pathsep}{ROOT / "test"}'},
        stdout=subprocess.PIPE, text=True,
    )
    pids = [int(pid) for pid in launch.stdout.readline().split()]
    assert len(pids) == 5
    wait_until(bag.exists)
    launch.terminate()
    assert launch.wait() == -signal.SIGTERM
    launch.stdout.close()
    wait_until(lambda: not any(map(is_alive, pids)))
    assert (bag / 'metadata.yaml').exists()


BAD = {
    'unknown shape': ('sim_node', ['-p', 'morphology:=bipd'], ['morphology', "'bipd'", 'biped']),
    'unconnected grid': ('sim_node', ['-p', 'morphology:=101'], ['morphology', 'connected']),
    'unknown terrain': ('sim_node', ['-p', 'terrain:=hily-1-10-0'], ['terrain', 'hilly']),
    'wrong type': ('sim_node', ['-p', 'duration:=long'], ['duration', "'long'", 'float']),
    'out of range': ('sim_node', ['-p', 'material.friction:=-1.0'], ['material.friction', '-1.0']),
    'unknown parameter': ('sim_node', ['-p', 'durration:=1.0'], ['durration', "'duration'"]),
    'QoS override': (
        'recorder_node', ['-p', 'qos_overrides./robot/odometry.subscription.depth:=5'],
        ['qos_overrides./robot/odometry', 'QoS of topics is fixed'],
    ),
    'best effort in lock-step': (
        'sim_node', ['-p', 'reliability:=best_effort'], ['/sim_node: reliability', 'lock-step']
    ),
    'best-effort voxel in lock-step': (
        'voxel_node', ['-p', 'reliability:=best_effort'], ['/voxel_0_0: reliability', 'lock-step']
    ),
    'unknown policy': ('sim_node', ['-p', 'on_silence:=wait'], ['on_silence', 'go_on']),
    'unknown physics': (
        'sim_node', ['-p', 'solver.physics:=frist'], ['solver.physics', "'frist'", "'first'"]
    ),
    'bundled name': (
        'sim_node', ['-p', f'controller:={DEFAULT_CONTROLLER}'], ['/sim_node: controller', 'path']
    ),
    'no controller file': (
        'sim_node', ['-p', f'controller:={__file__}'], ['/sim_node', __file__, 'file: got', '.npz']
    ),
    'self-collision': (
        'sim_node', ['-p', 'solver.self_collision:=maybe'], ['solver.self_collision', "'maybe'"]
    ),
    'no controller': ('voxel_node', ['-p', 'controller:=/nowhere.npz'], ['/nowhere.npz']),
    'no such neighbour': ('voxel_node', ['-p', 'neighbor.left:=x'], ['left', "'x'"]),
    'no such breakage': (
        'sim_node', ['-p', 'broken_sensors:=half:0.5'], ['broken_sensors', 'zero|frozen|random']
    ),
    'more than all voxels': (
        'voxel_node', ['-p', f'controller:={find_controller(DEFAULT_CONTROLLER)}',
                       '-p', 'death:=1.5'], ['death', "'1.5'"]
    ),
    'storage': ('recorder_node', ['-p', 'storage:=tape'], ['storage', "'tape'", 'mcap']),
    'bad remap': ('sim_node', ['-r', '__ns:=a b'], ['error']),
}


@pytest.mark.parametrize('case', BAD)
def test_bad_parameters_are_named(start, tmp_path, case):
    executable, given, expected = BAD[case]
    child = start(executable, '--ros-args', *given)
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 2, output
    assert 'Traceback' not in output
    lines = [line for line in output.splitlines() if 'error' in line]
    assert len(lines) == 1
    for text in expected:
        assert text in lines[0]
    assert not (tmp_path / 'bags').exists()


def test_params_file_is_named(start, tmp_path):
    params = tmp_path / 'wrong.yaml'
    params.write_text('/**:\n  ros__parameters:\n    duration: soon\n')
    child = start('sim_node', '--ros-args', '--params-file', params)
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 2
    assert str(params) in output
    assert 'duration' in output
    params.write_text('/**: [unbalanced\n')
    child = start('sim_node', '--ros-args', '--params-file', params)
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 2
    assert str(params) in output
    assert 'Traceback' not in output


def test_controller_of_another_shape_is_refused(start, make_controller):
    child = start(
        'voxel_node', 'voxel_3_1', '--ros-args', '-p', f'controller:={make_controller("11-10")}'
    )
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 2
    assert 'voxel_3_1' in output
    assert '11-10' in output
    assert 'Traceback' not in output


def test_existing_bag_is_not_touched(start, tmp_path):
    (tmp_path / 'bag').mkdir()
    (tmp_path / 'bag' / 'mine').write_text('precious')
    child = start('recorder_node', '--ros-args', '-p', f'bag:={tmp_path / "bag"}')
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 2
    assert 'bag' in output
    assert [p.name for p in (tmp_path / 'bag').iterdir()] == ['mine']


def test_one_process_hosts_several_voxels(start_node, node, spin_until, make_controller):
    path = make_controller('11-10')
    graph = describe_graph(
        path, load_controller(path), WalkOptions(robot='robot', voxels_per_process=2)
    )
    start_node(graph, graph.voxels[0])
    expected = {('voxel_0_0', '/robot'), ('voxel_0_1', '/robot')}
    spin_until(lambda: expected <= set(node.get_node_names_and_namespaces()))
    assert [process.names for process in graph.voxels] == [
        ('voxel_0_0', 'voxel_0_1'), ('voxel_1_1',)
    ]


def test_shipped_params_file_is_understood(start, node, spin_until):
    child = start(
        'sim_node', '--ros-args', '-r', '__ns:=/robot',
        '--params-file', ROOT / 'config' / 'params' / 'hilly.yaml',
    )
    spin_until(lambda: ('sim_node', '/robot') in node.get_node_names_and_namespaces())
    child.send_signal(signal.SIGINT)
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0, output


def test_nodes_share_no_memory(start, node, spin_until, make_controller, tmp_path):
    """The Fast DDS profile is in force: shared memory would outlive a killed process."""
    child = start(*arguments('voxel_node', make_controller(), tmp_path))
    spin_until(lambda: ('voxel_0_0', '/robot') in node.get_node_names_and_namespaces())
    assert '/dev/shm/fastrtps' not in Path(f'/proc/{child.pid}/maps').read_text()
