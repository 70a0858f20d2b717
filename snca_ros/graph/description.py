"""The processes of one robot's graph with their parameters, for `snca walk` and `ros2 launch`.

This module does not import ROS.
"""

import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from sim_node.engine import DEFAULT_ENGINE, check_engine
from sim_node.errors import InvalidInput
from sim_node.model.body_faults import BodyFaults, FaultsOfBody
from sim_node.model.constants import Checked, constant, same_as
from sim_node.model.morphology import DIRECTIONS, Morphology
from sim_node.model.terrain import parse_terrain
from sim_node.ros.sim_interface import SIM_NODE, RunOptions
from snca_ros.faults import NO_FAULTS, CellFaults, Faults
from snca_ros.files import check_new_bag, short_name
from snca_ros.nodes.interfaces import (
    RECORDER_NODE,
    VOXEL_NODE,
    RecorderOptions,
    VoxelOptions,
)
from snca_ros.trained_controller import TrainedController
from snca_ros.yaml_file import yaml_text

_LONGEST_NAME = 80  # of a default namespace; ROS allows 247 characters for a whole topic


@dataclass(frozen=True, eq=False)
class NodeProcess:
    """One process of the graph.

    Attributes:
        executable: its name for `ros2 run snca_ros <executable>`.
        names: arguments before --ros-args: the names of the nodes of a voxel process.
        parameters: parameters of each node, by the node's name.
    """

    executable: str
    parameters: dict[str, dict[str, object]]
    names: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        """Return the name of the first node of the process."""
        return next(iter(self.parameters))


@dataclass(frozen=True)
class Graph:
    """All processes of one robot in the namespace /<robot>.

    Attributes:
        robot: the namespace.
        simulation, voxels, recorder: processes on this machine; simulation is None if it runs on
            another machine, recorder is None if nothing is recorded.
    """

    robot: str
    simulation: NodeProcess | None
    voxels: tuple[NodeProcess, ...]
    recorder: NodeProcess | None = None

    @property
    def processes(self) -> tuple[NodeProcess, ...]:
        """Return all processes in the order in which to start them."""
        return tuple(p for p in (self.recorder, self.simulation, *self.voxels) if p)

    def enclave(self, name: str) -> str:
        """Return the SROS 2 enclave of the process whose first node is `name`.

        ROS ignores it when security is off.
        """
        return f'/{self.robot}/{name}'

    def parameters_yaml(self) -> str:
        """Return the content of a params file (--params-file) with the parameters of all nodes."""
        nodes = {}
        for process in self.processes:
            for name, values in process.parameters.items():
                nodes[f'/{self.robot}/{name}'] = {'ros__parameters': values}
        return yaml_text(nodes)


@dataclass(frozen=True)
class WalkOptions(Checked):
    """Options of a walk; see the help of `snca walk`.

    `only` selects the voxels of this machine (see `choose_voxels`); with `one_walk` they end when
    the simulation ends. `devices` has the addresses of the devices that cells are on, by voxel.

    Raises:
        InvalidInput: a value has the wrong type or is out of range.
    """

    robot: str = ''
    terrain: str = ''
    engine: str = ''
    duration: float = constant(30.0, 0.0, 1e5, 'simulated time to walk', 's')
    real_time_factor: float = same_as(RunOptions, 'real_time_factor')
    voxels_per_process: int = constant(1, 1, 1000, 'voxels that share a process')
    only: str = ''
    one_walk: bool = False
    bag: str = ''
    storage: str = same_as(RecorderOptions, 'storage')
    reliability: str = same_as(RunOptions, 'reliability')
    faults: Faults = NO_FAULTS
    simulation: dict[str, Any] = field(default_factory=dict)
    arithmetic: str = same_as(VoxelOptions, 'arithmetic')
    devices: dict[str, str] = field(default_factory=dict)

    @property
    def reach(self) -> str:
        """Return how far the graph reaches, see `graph_environment`."""
        return 'network' if self.only else 'loopback'

    @property
    def patience(self) -> float:
        """Return how long a voxel waits for a neighbour [s]; 0 means without limit.

        There is a limit only if `on_silence` is `go_on`. It is a quarter of `silence_limit`, so
        that the neighbours of a dead voxel answer before the simulation takes them for silent too.
        """
        if self.simulation.get('on_silence') != 'go_on':
            return 0.0
        return float(self.simulation.get('silence_limit', RunOptions.silence_limit)) / 4.0


def describe_graph(
    controller: Path, trained: TrainedController, options: WalkOptions
) -> Graph:
    """Return the graph of the robot of a controller file.

    Args:
        controller: path of the controller file.
        trained: its content.
        options: of the walk.

    Raises:
        InvalidInput: the robot's name is no ROS name, a path is not UTF-8, `only` names no voxels
            of this robot, or a process would refuse its parameters.
    """
    for name, path in (('controller', str(controller)), ('bag', options.bag)):
        _check_utf8(name, os.path.abspath(path))
    morphology = trained.morphology
    _check_parameters(trained, options)
    k = options.voxels_per_process
    robot = options.robot or robot_name(morphology)
    if not (robot.isascii() and robot.isidentifier()):
        raise InvalidInput('robot', robot, 'letters, digits and _, not starting with a digit')
    names = choose_voxels(morphology, options.only)
    groups = [names[i : i + k] for i in range(0, len(names), k)]
    recorder = None
    if options.bag:
        bag: dict[str, object] = {
            'bag': os.path.abspath(options.bag), 'storage': options.storage,
            'reliability': options.reliability,
        }
        recorder = NodeProcess(RECORDER_NODE.name, {RECORDER_NODE.name: bag})
    return Graph(
        robot,
        NodeProcess(SIM_NODE.name, {SIM_NODE.name: _simulation_parameters(trained, options)}),
        tuple(
            NodeProcess(
                VOXEL_NODE.name,
                {name: _voxel_parameters(name, morphology, controller, options)
                 for name in group},
                group,
            )
            for group in groups
        ),
        recorder,
    )


def _check_parameters(trained: TrainedController, options: WalkOptions) -> None:
    """Check what the processes check when they start, so that none is started in vain."""
    parse_terrain(options.terrain or trained.terrain)
    check_engine(options.engine or DEFAULT_ENGINE, trained.solver)
    run: dict[str, Any] = {
        'duration': options.duration, 'real_time_factor': options.real_time_factor,
        'reliability': options.reliability, **options.simulation,
    }
    RunOptions(**{k: v for k, v in run.items() if k in RunOptions.__dataclass_fields__})
    n_sensors = len(trained.architecture.sensors)
    BodyFaults(trained.morphology, FaultsOfBody(**options.faults.of_body), n_sensors)
    CellFaults(options.faults, trained.morphology)
    if options.bag:
        check_new_bag(Path(options.bag), options.storage)


def _check_utf8(name: str, path: str) -> None:
    try:
        path.encode()
    except UnicodeEncodeError:
        expected = 'a path in UTF-8, as ROS parameters are'
        raise InvalidInput(name, path, expected) from None


def choose_voxels(morphology: Morphology, only: str) -> tuple[str, ...]:
    """Return the names of the voxels that `only` selects, in index order.

    Args:
        morphology: of the robot.
        only: `K/N`, the Kth of N equal shares; or names, voxel_<x>_<y>, separated by commas; or
            `none`; empty for all.

    Raises:
        InvalidInput: there is no such share or voxel.
    """
    names = morphology.voxel_names
    if not only:
        return names
    if only == 'none':
        return ()
    if share := re.fullmatch(r'(\d{1,4})/(\d{1,4})', only, re.ASCII):
        k, n = int(share[1]), int(share[2])
        if not 1 <= k <= n <= len(names):
            raise InvalidInput('only', only, f'K/N with 1 <= K <= N <= {len(names)}')
        return names[(k - 1) * len(names) // n : k * len(names) // n]
    chosen = {morphology.index_of(name) for name in only.split(',')}
    return tuple(names[i] for i in sorted(chosen))


def _simulation_parameters(
    trained: TrainedController, options: WalkOptions
) -> dict[str, object]:
    return {
        'morphology': trained.morphology.grid_string,
        'sensors': ','.join(trained.architecture.sensors),
        'terrain': options.terrain or trained.terrain,
        'engine': options.engine or DEFAULT_ENGINE,
        'duration': float(options.duration),
        'real_time_factor': float(options.real_time_factor),
        'reliability': options.reliability,
        'recorders': 1 if options.bag else 0,
        **{f'material.{k}': v for k, v in vars(trained.material).items()},
        **{f'solver.{k}': v for k, v in vars(trained.solver).items()},
        **options.faults.of_body,
        **options.simulation,
    }


def _voxel_parameters(
    name: str, morphology: Morphology, controller: Path, options: WalkOptions
) -> dict[str, object]:
    row = morphology.neighbors[morphology.index_of(name)]
    neighbors = {
        f'neighbor.{d}': morphology.voxel_names[j]
        for d, j in zip(DIRECTIONS, row, strict=True) if j >= 0
    }
    return {
        'controller': os.path.abspath(controller), 'patience': options.patience,
        'real_time': options.real_time_factor > 0.0, 'reliability': options.reliability,
        'one_walk': options.one_walk, **neighbors,
        'arithmetic': options.arithmetic, 'device': options.devices.get(name, ''),
        **options.faults.of_cells,
    }


def robot_name(morphology: Morphology) -> str:
    """Return the default namespace of a robot of this shape."""
    text = ''.join(c if c.isascii() and c.isalnum() else '_' for c in morphology.name)
    text = text if text[:1].isalpha() else f'robot_{text}'
    return short_name(text, _LONGEST_NAME).replace('-', '_')
