"""Bring up one robot: its simulation, its voxels, each a process, and a recorder.

ros2 launch snca_ros robot.launch.py controller:=FILE.npz bag:=walk.bag voxels_per_process:=1
"""

import shutil
import tempfile
from pathlib import Path

from launch.actions import (
    DeclareLaunchArgument,
    OpaqueFunction,
    RegisterEventHandler,
    Shutdown,
)
from launch.event_handlers import OnShutdown
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from launch import LaunchDescription
from sim_node.errors import InvalidInput
from snca_ros.bundled import DEFAULT_CONTROLLER, find_controller
from snca_ros.controller_file import load_controller
from snca_ros.faults import parse_faults
from snca_ros.graph.description import WalkOptions, describe_graph

ARGUMENTS = {
    'controller': (DEFAULT_CONTROLLER, 'controller file, or the name of a bundled one'),
    'robot': ('', 'namespace; default: the shape'),
    'terrain': ('', 'default: the terrain of the controller file'),
    'duration': ('30.0', 'simulated seconds; 0: until stopped'),
    'real_time_factor': ('0.0', 'simulated time over wall time; 0: lock-step'),
    'voxels_per_process': ('1', 'voxel nodes per process'),
    'bag': ('', 'bag to write; empty: none'),
    'storage': ('mcap', 'mcap | sqlite3'),
    'faults': ('', 'what goes wrong, such as loss=0.3,death=0.5@10, or a YAML file'),
}


def _number(name, text, kind):
    """Return a launch argument as a number; InvalidInput if it is none."""
    try:
        return kind(text)
    except ValueError:
        raise InvalidInput(name, text, f'a number ({kind.__name__})') from None


def _nodes(context):
    """Turn the description of the graph into launch actions."""
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    path = find_controller(value['controller'])
    options = WalkOptions(
        robot=value['robot'],
        terrain=value['terrain'],
        duration=_number('duration', value['duration'], float),
        real_time_factor=_number('real_time_factor', value['real_time_factor'], float),
        voxels_per_process=_number('voxels_per_process', value['voxels_per_process'], int),
        bag=value['bag'],
        storage=value['storage'],
        faults=parse_faults(value['faults']),
    )
    graph = describe_graph(path, load_controller(path), options)
    params = Path(tempfile.mkdtemp(prefix='snca_ros_')) / 'params.yaml'
    params.write_text(graph.parameters_yaml())

    def clean_up(event, context):
        shutil.rmtree(params.parent, ignore_errors=True)

    return [
        RegisterEventHandler(OnShutdown(on_shutdown=clean_up)),
        *(_node(graph, process, params) for process in graph.processes),
    ]


def _node(graph, process, params):
    needed = process in (graph.simulation, graph.recorder)
    return Node(
        package='snca_ros', executable=process.executable, namespace=f'/{graph.robot}',
        arguments=list(process.names), parameters=[str(params)], output='screen',
        ros_arguments=['--enclave', graph.enclave(process.name)],
        on_exit=Shutdown() if needed else None,
    )


def generate_launch_description():
    """Return the launch description."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=_nodes)])
