"""Declarations of the simulation node's parameters, topics and services."""

from dataclasses import dataclass

from sim_node.control_time import CONTROL_RATE, MARKER_PERIOD
from sim_node.engine import DEFAULT_ENGINE, ENGINES
from sim_node.errors import InvalidInput
from sim_node.model.body_faults import FaultsOfBody
from sim_node.model.constants import Checked, choice, constant, flag, text_value
from sim_node.model.material import Material
from sim_node.model.morphology import DEFAULT_SHAPE
from sim_node.model.sensors import DEFAULT_SENSORS
from sim_node.model.solver import Solver
from sim_node.model.terrain import DEFAULT_TERRAIN, TERRAIN_FORM
from sim_node.ros.interface import DIAGNOSTICS, ROSOUT, NodeInterface, Parameters, Service, Topic

RELIABLE, BEST_EFFORT = 'reliable', 'best_effort'

_EACH_STEP = f'every control step, {CONTROL_RATE} per simulated second'

CLOCK = Topic(
    '/clock', 'rosgraph_msgs/msg/Clock', _EACH_STEP,
    'simulated time; on `<robot>/clock` if another node publishes /clock already',
)
OWN_CLOCK = 'clock'
"""The topic of simulated time of a robot while another node publishes /clock."""

ODOMETRY = Topic(
    'odometry', 'nav_msgs/msg/Odometry', _EACH_STEP,
    "robot's centre [m] and velocity [m/s], x forward, z up; frame `world`",
)
MARKERS = Topic(
    'markers', 'visualization_msgs/msg/MarkerArray',
    f'{CONTROL_RATE // MARKER_PERIOD} per simulated second; the ground once per simulated second',
    'voxels coloured by area ratio, their outlines, and the ground; frame `world`',
)
SENSORS = Topic(
    'sensors', 'sensor_msgs/msg/JointState', _EACH_STEP,
    f'readings of step k: stamp k; name of each sensor, by default {", ".join(DEFAULT_SENSORS)}; '
    'position = readings in [0, 1]',
    of_voxel=True,
)
APPLIED = Topic(
    'applied_actuation', 'sensor_msgs/msg/JointState', _EACH_STEP,
    'what moved the body in step k, broken actuators included: stamp k; name = all voxels, row by '
    'row from the bottom; position = actuation in [-1, 1]; effort = age in steps of the answer '
    'that it is from (not a torque): 0 in time, n > 0 held from step k − n, −1 none that counts, '
    'the voxel is limp; frame `<robot>@<episode>`',
)
ACTUATION = Topic(
    'actuation', 'sensor_msgs/msg/JointState', 'once for each `sensors`',
    'answer to the `sensors` of the same stamp: name = the voxel; position = [a] in [-1, 1], '
    '1 contracts, -1 expands',
    of_voxel=True,
)
PRESENCE = Topic(
    '_simulation_*', 'std_msgs/msg/String', 'twice per second of wall time',
    'hidden topic of one simulation: * = its identity, the four digits that the names of its '
    'episodes have in common; host, process id, and `starting` or `running`',
)


@dataclass(frozen=True)
class BodyOptions(Checked):
    """Options that select the body and its world; a controller file gives other defaults.

    Raises:
        InvalidInput: a value is invalid.
    """

    controller: str = text_value(
        '', 'controller file with the defaults of morphology, terrain, sensors, material and '
        'solver', 'path of a file, .npz',
    )
    morphology: str = text_value(
        DEFAULT_SHAPE, 'shape of the robot', 'name or grid, e.g. biped, comb-7x2, 1111-1001'
    )
    terrain: str = text_value(DEFAULT_TERRAIN, 'ground', TERRAIN_FORM)
    sensors: str = text_value(
        ','.join(DEFAULT_SENSORS), 'what each voxel senses', 'names separated by commas'
    )
    engine: str = choice(DEFAULT_ENGINE, ENGINES, 'physics engine')


@dataclass(frozen=True)
class RunOptions(Checked):
    """Options of the run of a simulation node.

    Raises:
        InvalidInput: a value is invalid, or the links are best effort in lock-step.
    """

    duration: float = constant(
        0.0, 0.0, 1e6, 'simulated time after which the node ends, 0 for never', 's'
    )
    silence_limit: float = constant(
        10.0, 0.1, 3600.0, 'wall time within which a voxel must answer', 's'
    )
    start_limit: float = constant(
        60.0, 0.1, 3600.0, 'wall time within which all voxels must answer for the first time', 's'
    )
    on_silence: str = choice(
        'stop', ('stop', 'go_on'), 'what to do if a voxel does not answer: end with an error that '
        'names it, or continue without it (`patience` of the voxels must be below `silence_limit`)'
    )
    real_time_factor: float = constant(
        0.0, 0.0, 100.0, 'simulated time over wall time, kept without waiting for voxels (which '
        'need `real_time`); 0 for lock-step, as fast as all voxels answer'
    )
    hold_limit: float = constant(
        0.25, 0.0, 3600.0, 'real time: wall time without an answer after which the actuation of a '
        'voxel is 0; until then it holds its last value; at least two steps', 's'
    )
    recorders: int = constant(
        0, 0, 10, 'recorders that must have subscribed before step 0 is published'
    )
    clock: str = text_value(
        '', 'topic of simulated time; default: /clock, or <robot>/clock if another node publishes '
        '/clock already', 'name of a topic',
    )
    start_paused: bool = flag(False, 'start paused: wait for the service `pause` (false) or `step`')
    reliability: str = choice(
        RELIABLE, (RELIABLE, BEST_EFFORT), 'QoS of sensors, actuation, spikes and values, the same '
        'for all nodes of a robot; best_effort, in real time only: lost messages are not sent again'
    )

    def __post_init__(self) -> None:
        super().__post_init__()
        check_reliability(self.reliability, self.real_time_factor > 0.0)


def check_reliability(reliability: str, real_time: bool) -> None:
    """Raise InvalidInput if links are best effort in lock-step."""
    if reliability == BEST_EFFORT and not real_time:
        expected = f'{RELIABLE} in lock-step, which needs every message, or real time'
        raise InvalidInput('reliability', reliability, expected)


CONTROLLER = Parameters(BodyOptions, only=('controller',))
WORLD = Parameters(BodyOptions, only=('morphology', 'terrain', 'sensors', 'engine'))
RUN = Parameters(RunOptions)
FAULTS = Parameters(FaultsOfBody)
MATERIAL = Parameters(Material, 'material.')
SOLVER = Parameters(Solver, 'solver.')

RESET = Service('reset', 'std_srvs/srv/Trigger', 'put the robot down again: a new episode')
PAUSE = Service('pause', 'std_srvs/srv/SetBool', 'pause (true) or continue (false)')
STEP = Service('step', 'std_srvs/srv/Trigger', 'make one control step while paused')

SIM_NODE = NodeInterface(
    'sim_node', 'Simulation',
    "Simulates the robot's body in its world: it publishes the readings of each voxel, waits for "
    'their actuation (or, in real time, until the step is due), and makes the step.',
    'ros2 run snca_ros sim_node --ros-args -r __ns:=/<robot> -p <parameter>:=<value>',
    parameters=(CONTROLLER, WORLD, RUN, FAULTS, SOLVER, MATERIAL),
    publishes=(SENSORS, ODOMETRY, MARKERS, APPLIED, CLOCK, PRESENCE, DIAGNOSTICS, ROSOUT),
    subscribes=(ACTUATION, PRESENCE),
    serves=(RESET, PAUSE, STEP),
)
