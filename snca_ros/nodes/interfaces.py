"""Declares parameters and topics of the voxel node, the recorder node and the live view."""

from dataclasses import astuple, dataclass

from sim_node.model.constants import Checked, choice, constant, flag, same_as, text_value
from sim_node.ros.interface import DIAGNOSTICS, ROSOUT, NodeInterface, Parameters, Topic
from sim_node.ros.sim_interface import (
    ACTUATION,
    APPLIED,
    CLOCK,
    MARKERS,
    ODOMETRY,
    PRESENCE,
    SENSORS,
    RunOptions,
    check_reliability,
)
from snca_ros.cell.coding import SNN_STEPS
from snca_ros.cell.models.arithmetic import ARITHMETICS, DEFAULT_ARITHMETIC
from snca_ros.faults import FAULTS_OF_CELLS, Faults
from snca_ros.firmware.lines import EXPECTED

STORAGES = ('mcap', 'sqlite3')
"""Storage formats of bags."""

VIEW_RATE = 30
"""Frames of the live view per second of wall time."""

_AFTER_STEP = 'once per `sensors` message, before `actuation`'
_ROWS = 'n_c rows (nD), or 4 n_c rows (D: those for above, left, below, right)'

SPIKES = Topic(
    'spikes', 'sensor_msgs/msg/Image', _AFTER_STEP,
    f'message of an SNN cell to its neighbours, stamped with its control step: `mono8`, '
    f'{SNN_STEPS} SNN steps wide, {_ROWS}; 0 or 255',
    of_voxel=True,
)
VALUES = Topic(
    'values', 'sensor_msgs/msg/Image', _AFTER_STEP,
    f'message of an MLP cell to its neighbours, stamped with its control step: `64FC1`, 1 wide, '
    f'{_ROWS}; from -1 to 1',
    of_voxel=True,
)

LINKS = (SENSORS, ACTUATION, SPIKES, VALUES)
"""Topics whose QoS the parameter `reliability` selects."""


@dataclass(frozen=True)
class VoxelOptions(Checked):
    """Parameters of a voxel node.

    Raises:
        InvalidInput: a value has the wrong type or is out of range, or the links are best effort in
            lock-step.
    """

    voxel: str = text_value('', "name of this voxel; default: the node's name", 'voxel_<x>_<y>')
    controller: str = text_value(
        '', 'controller file that holds the parameters of the cells', 'path of a file, .npz'
    )
    patience: float = constant(
        0.0, 0.0, 3600.0, "wall time to wait for a neighbour's message before the voxel steps "
        'without it, 0 for no limit', 's'
    )
    real_time: bool = flag(
        False, "step when sensors arrive, without waiting for the neighbours' messages"
    )
    one_walk: bool = flag(False, 'end when the simulation ends')
    arithmetic: str = choice(
        DEFAULT_ARITHMETIC, ARITHMETICS, 'arithmetic of the cell, as that of its firmware'
    )
    device: str = text_value(
        '', 'device that the cell is on; empty for a cell in the process of the node', EXPECTED
    )
    reliability: str = same_as(RunOptions, 'reliability')

    def __post_init__(self) -> None:
        super().__post_init__()
        check_reliability(self.reliability, self.real_time)


@dataclass(frozen=True)
class NeighborNames(Checked):
    """Names of a voxel's neighbours, in the order of `sim_node.model.morphology.DIRECTIONS`.

    Raises:
        InvalidInput: a value is no text.
    """

    above: str = text_value('', 'voxel above this one; empty for none', 'voxel_<x>_<y>')
    left: str = text_value('', 'voxel left of this one; empty for none', 'voxel_<x>_<y>')
    below: str = text_value('', 'voxel below this one; empty for none', 'voxel_<x>_<y>')
    right: str = text_value('', 'voxel right of this one; empty for none', 'voxel_<x>_<y>')

    @property
    def by_direction(self) -> tuple[str, ...]:
        """Return the names in the order of directions; empty where there is no neighbour."""
        return astuple(self)


@dataclass(frozen=True)
class RecorderOptions(Checked):
    """Parameters of the recorder node.

    Raises:
        InvalidInput: a value has the wrong type, or there is no such storage format.
    """

    bag: str = text_value(
        '', 'folder of the bag to write, which must not exist; default: bags/<date>-<time>',
        'path of a folder',
    )
    storage: str = choice(STORAGES[0], STORAGES, 'storage format of the bag')
    reliability: str = same_as(RunOptions, 'reliability')


@dataclass(frozen=True)
class ViewOptions(Checked):
    """Options of the live view, which `snca walk` has.

    Raises:
        InvalidInput: a value has the wrong type or is out of range.
    """

    port: int = constant(8765, 0, 65535, 'port of the live page, 0 for a free one')


VOXEL = Parameters(VoxelOptions)
NEIGHBORS = Parameters(NeighborNames, 'neighbor.')
FAULTS = Parameters(Faults, only=FAULTS_OF_CELLS)
RECORDER = Parameters(RecorderOptions)

_OF_ROBOT = (SENSORS, ACTUATION, SPIKES, VALUES, ODOMETRY, MARKERS, APPLIED)

VOXEL_NODE = NodeInterface(
    'voxel_node', 'Voxel',
    'Runs the cell of one voxel: when it has received the readings of a step and the messages that '
    'its neighbours sent one step before, it steps the cell and publishes its message, then its '
    'actuation. Before it joins, it subscribes to its own `actuation`, to detect another node of '
    'the same voxel. The node is named after its voxel.',
    'ros2 run snca_ros voxel_node voxel_0_0 --ros-args -r __ns:=/<robot> '
    '-p controller:=<file>.npz -p neighbor.right:=voxel_1_0',
    parameters=(VOXEL, NEIGHBORS, FAULTS),
    publishes=(ACTUATION, SPIKES, VALUES, DIAGNOSTICS, ROSOUT),
    subscribes=(SENSORS, SPIKES, VALUES, ACTUATION, PRESENCE),
)
RECORDER_NODE = NodeInterface(
    'recorder_node', 'Recorder',
    'Writes every message of the namespace, and of the global topics below, into a rosbag2 bag. '
    'Topics of the namespace that are not listed here are recorded, too, with any type that is '
    'installed; hidden topics (with a name that begins with _) are not.',
    'ros2 run snca_ros recorder_node --ros-args -r __ns:=/<robot> -p bag:=<folder>',
    parameters=(RECORDER,),
    publishes=(DIAGNOSTICS, ROSOUT),
    subscribes=(*_OF_ROBOT, CLOCK, DIAGNOSTICS, ROSOUT),
)
VIEW_NODE = NodeInterface(
    'view', 'Live view',
    f'Subscribes to all topics of a robot and sends frames to the page of `snca walk --view`, '
    f'{VIEW_RATE} per second of wall time. It runs in the process of that command; `ros2 run` '
    'cannot start it.',
    'snca walk <controller> --view',
    publishes=(DIAGNOSTICS,),
    subscribes=(*_OF_ROBOT, DIAGNOSTICS),
)
NODES = (VOXEL_NODE, RECORDER_NODE, VIEW_NODE)
