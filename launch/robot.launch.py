"""Start one robot: a simulation, a process per voxel (or per group of voxels), and a recorder.

ros2 launch snca_ros robot.launch.py controller:=FILE.npz bag:=walk.bag voxels_per_process:=1
"""

import os
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
from sim_node.model.constants import declaration, describe, value_of
from snca_ros.bundled import DEFAULT_CONTROLLER, find_controller
from snca_ros.controller_file import load_controller, save_controller
from snca_ros.faults import FAULTS_HELP, parse_faults
from snca_ros.files import write_text
from snca_ros.graph.child_process import PARENT
from snca_ros.graph.description import WalkOptions, describe_graph


def _declared(name, more=''):
    """Return the default and the description of an argument that `WalkOptions` declares."""
    f = declaration(WalkOptions, name)
    return str(f.default), describe(f) + more


ARGUMENTS = {
    'controller': (DEFAULT_CONTROLLER, 'controller file, or the name of a bundled one'),
    'shape': ('', 'another body for a uniform controller, such as tripod'),
    'without': ('', 'voxels to leave out of the body: voxel_1_1,voxel_2_1,...'),
    'robot': ('', 'namespace of the robot; default: the name of its shape'),
    'terrain': ('', 'name of the terrain; default: the terrain of the controller file'),
    'duration': _declared('duration', '; 0: until stopped'),
    'real_time_factor': _declared('real_time_factor'),
    'reliability': _declared('reliability'),
    'voxels_per_process': _declared('voxels_per_process'),
    'bag': ('', 'folder of the bag to write; empty: nothing is recorded'),
    'storage': _declared('storage'),
    'faults': ('', FAULTS_HELP),
}


def _nodes(context):
    """Return the launch actions of the graph."""
    value = {name: LaunchConfiguration(name).perform(context) for name in ARGUMENTS}
    path = find_controller(value['controller'])
    options = WalkOptions(
        robot=value['robot'],
        terrain=value['terrain'],
        bag=value['bag'],
        faults=parse_faults(value['faults']),
        **{
            name: value_of(name, value[name], declaration(WalkOptions, name))
            for name in (
                'duration', 'real_time_factor', 'reliability', 'voxels_per_process', 'storage'
            )
        },
    )
    own = load_controller(path)
    trained = own.in_body(value['shape']).without(value['without'])
    describe_graph(path, trained, options)  # raises InvalidInput before a folder is made
    folder = Path(tempfile.mkdtemp(prefix='snca_ros_'))
    if trained is not own:
        path = folder / path.name
        save_controller(path, trained)
    graph = describe_graph(path, trained, options)
    params = folder / 'params.yaml'
    write_text(params, graph.parameters_yaml())

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
        # Launch does not end its processes when it is terminated or killed itself.
        additional_env={PARENT: str(os.getpid())},
    )


def generate_launch_description():
    """Return the launch description."""
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=text)
        for name, (default, text) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, OpaqueFunction(function=_nodes)])
