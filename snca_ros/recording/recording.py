"""A recorded walk as arrays over control steps, with message counts and diagnostics."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.model.meetings import walls_in_outlines
from sim_node.model.morphology import Morphology
from sim_node.model.physics import UNNAMED_PHYSICS
from sim_node.model.sensors import DEFAULT_SENSORS
from sim_node.walls import NO_WALLS, Walls
from snca_ros.recording.diagnostics import NodeHealth
from snca_ros.recording.gait import walked_velocity
from snca_ros.recording.poses import Poses


def _no_steps() -> np.ndarray:
    return np.zeros(0, dtype=np.int64)


@dataclass(frozen=True, eq=False)
class TopicCount:
    """The numbers of received, late, missing and refused messages of a topic.

    Attributes:
        topic: its full name.
        received: messages in the bag; of a stamped topic, control steps of the episode.
        missing: control steps whose message was sent and is not in the bag; None if the topic
            carries no control steps, so that missing messages cannot be counted.
        refused: messages in the bag that have another type or layout than the topic's, another
            episode than those of the bag, or a stamp after the robot's last step; no array
            contains them.
        late: control steps whose message is in the bag, but came too late to be used.
        unsent: control steps at which the voxel sent nothing, for it was dead.
        killed: those of `missing` that were lost by a kill of the voxel, at most one per kill: the
            simulation had the message and the recorder did not.
        twice: control steps of which there are several messages with different content, for the
            voxel was killed and restarted: the arrays contain the first, and each neighbour used
            the first that it received.
        unheard: control steps whose message is in the bag, but was lost on the way to the
            simulation, over a best-effort link.
        unrecorded: those of `missing` that the simulation had in time, over a best-effort link.
        kind: sensors, spikes, odometry, ..., also if the topic is remapped; empty if `missing` is
            None.
    """

    topic: str
    received: int
    missing: np.ndarray | None = None
    refused: int = 0
    late: np.ndarray = field(default_factory=_no_steps)
    unsent: np.ndarray = field(default_factory=_no_steps)
    killed: np.ndarray = field(default_factory=_no_steps)
    twice: np.ndarray = field(default_factory=_no_steps)
    unheard: np.ndarray = field(default_factory=_no_steps)
    unrecorded: np.ndarray = field(default_factory=_no_steps)
    kind: str = ''

    @property
    def lost_steps(self) -> np.ndarray:
        """Return the control steps whose message was lost; none if they cannot be counted."""
        missing = _no_steps() if self.missing is None else self.missing
        return np.union1d(np.setdiff1d(missing, self.unrecorded), self.unheard)

    @property
    def lost(self) -> int:
        """Return the number of lost messages; 0 if they cannot be counted."""
        return len(self.lost_steps)

    @property
    def in_time(self) -> int:
        """Return the number of messages that came in time."""
        return self.sent - self.lost - len(self.late)

    @property
    def sent(self) -> int:
        """Return the number of messages sent; those received if the others cannot be counted."""
        return self.received + (0 if self.missing is None else len(self.missing))


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """One episode of a bag. Row k of an array is control step k; NaN marks missing numbers.

    Attributes:
        path: of the bag.
        closed: whether the recorder closed the bag; False after a kill.
        robot: namespace of the robot, without the leading slash.
        episode, n_episodes: number of this episode, from 0, and how many there are; a reset starts
            a new one.
        voxel_names: in the morphology's order, row by row from the bottom.
        centers: (n_steps, 2) centre of mass x, y [m].
        readings: (n_steps, n_voxels, n_sensors) in [0, 1].
        actuation: (n_steps, n_voxels) in [-1, 1], the answers of the voxels, also late ones.
        applied: (n_steps, n_voxels) in [-1, 1], the actuation that moved the body, with held and
            limp values; from `applied_actuation`, or, in older bags, from the order of messages.
        outcomes: (n_steps, n_voxels) `snca_ros.recording.outcomes.Outcome` of each answer: in
            time, held, limp or unknown.
        spikes: (n_steps, n_voxels, n_channels, 16) uint8 0 or 1; None if the cells send none.
        values: (n_steps, n_voxels, n_channels) in [-1, 1]; None if the cells send none.
        heard: (n_steps, n_voxels) whether the spikes or values came in time to be used. Those
            that are not in the bag are 0 or NaN.
        late: (n_steps, n_voxels) whether the spikes or values are in the bag, but came too late.
        rate: control steps per second of wall time; NaN if it is unknown.
        counts: one per topic, sorted by name; of an expected topic that is absent, all messages
            are missing.
        health: last diagnostics of each node, by its name; of all episodes.
        poses: outlines of the voxels; None if the bag has no markers.
        physics: name of the physics, one of `sim_node.model.physics.PHYSICS`, or
            `sim_node.episode.UNKNOWN_PHYSICS`.
        sensors: names of the readings, in their order.
        body: the voxels on their grid, with those that were left out; None if the bag does not say.
    """

    path: Path
    closed: bool
    robot: str
    episode: int
    n_episodes: int
    voxel_names: tuple[str, ...]
    centers: np.ndarray
    readings: np.ndarray
    actuation: np.ndarray
    applied: np.ndarray
    outcomes: np.ndarray
    spikes: np.ndarray | None
    values: np.ndarray | None
    heard: np.ndarray
    late: np.ndarray
    rate: float
    counts: tuple[TopicCount, ...]
    health: dict[str, NodeHealth]
    poses: Poses | None = None
    physics: str = UNNAMED_PHYSICS
    sensors: tuple[str, ...] = DEFAULT_SENSORS
    body: Morphology | None = None

    @property
    def n_steps(self) -> int:
        """Return the number of rows: the number of the last control step plus one."""
        return len(self.centers)

    @property
    def times(self) -> np.ndarray:
        """Return the simulated time of each row [s], (n_steps,)."""
        return np.arange(self.n_steps) / CONTROL_RATE

    @property
    def walls(self) -> Walls:
        """Return the walls that the robot met; none if there are no poses."""
        if self.poses is None:
            return NO_WALLS
        feet = self.poses.ground[[1, -2], 0]
        return walls_in_outlines(self.poses.steps, self.poses.corners, feet)

    @property
    def v_x(self) -> float:
        """Return the mean velocity [m/s] after the first 5 s, or of all of a shorter walk.

        It is measured until the robot meets the wall at the end of the ground, see `walls`.
        """
        return walked_velocity(self.walls.free_part(self.centers[:, 0]))

    def __repr__(self) -> str:
        kinds = [kind for kind in ('spikes', 'values', 'poses') if getattr(self, kind) is not None]
        episode = f', episode {self.episode} of {self.n_episodes}' if self.n_episodes > 1 else ''
        return (
            f"Recording('{self.path}': {self.robot}, {len(self.voxel_names)} voxels, "
            f'{self.n_steps} steps, {self.times[-1]:.1f} s{episode}, v_x {self.v_x:.3f} m/s'
            f'{"".join(f", {one}" for one in [*self.walls.describe(), *kinds])})'
        )
