"""What a recorded walk was, as arrays over control steps."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.model.physics import UNNAMED_PHYSICS
from sim_node.model.sensors import DEFAULT_SENSORS
from snca_ros.recording.diagnostics import NodeHealth
from snca_ros.recording.gait import walked_velocity
from snca_ros.recording.poses import Poses


@dataclass(frozen=True, eq=False)
class TopicCount:
    """How many messages of a topic arrived.

    Attributes:
        topic: its full name.
        received: messages in the bag; of a stamped topic, control steps of the episode.
        missing: control steps that were sent and are not in the bag; None if the topic carries
            no control step, so that nobody can tell.
        refused: messages of the bag that are not what this topic carries, or are stamped later
            than the robot went; they are in no array.
    """

    topic: str
    received: int
    missing: np.ndarray | None = None
    refused: int = 0

    @property
    def kind(self) -> str:
        """Return the last part of the topic's name: sensors, spikes, odometry, ..."""
        return self.topic.rpartition('/')[2]

    @property
    def lost(self) -> int:
        """Return how many messages are missing, as far as one can tell."""
        return 0 if self.missing is None else len(self.missing)

    @property
    def sent(self) -> int:
        """Return how many messages were sent, as far as one can tell."""
        return self.received + self.lost


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """One episode of a bag. Row k of an array is control step k; numbers not in it are NaN.

    Attributes:
        path: the bag.
        closed: whether the recorder had finished the bag; False after a kill.
        robot: its namespace, without the leading slash.
        episode, n_episodes: which one this is, from 0, of how many; a reset starts a new one.
        voxel_names: in the morphology's order, row by row from the bottom.
        centers: (n_steps, 2) centre of mass x, y [m].
        readings: (n_steps, n_voxels, n_sensors) in [0, 1].
        actuation: (n_steps, n_voxels) in [-1, 1].
        spikes: (n_steps, n_voxels, n_channels, 16) uint8 0 or 1; None if the cells send none.
        values: (n_steps, n_voxels, n_channels) in [-1, 1]; None if the cells send none.
        heard: (n_steps, n_voxels) whether the spikes or values are in the bag; spikes that are
            not are 0.
        rate: control steps per second of wall time; NaN if the bag does not tell.
        counts: one per topic, sorted by name; a topic that should be there and is not has lost
            everything.
        health: what each node said of itself, by its name; of all episodes.
        poses: what the robot looked like; None if the bag has no markers.
        physics: by which the body moved, one of `sim_node.model.physics.PHYSICS`, or
            `sim_node.episode.UNKNOWN_PHYSICS`.
        sensors: names of the readings, in their order.
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
    spikes: np.ndarray | None
    values: np.ndarray | None
    heard: np.ndarray
    rate: float
    counts: tuple[TopicCount, ...]
    health: dict[str, NodeHealth]
    poses: Poses | None = None
    physics: str = UNNAMED_PHYSICS
    sensors: tuple[str, ...] = DEFAULT_SENSORS

    @property
    def n_steps(self) -> int:
        """Return the number of control steps, the last one's number plus one."""
        return len(self.centers)

    @property
    def times(self) -> np.ndarray:
        """Return the simulated time of each row [s], (n_steps,)."""
        return np.arange(self.n_steps) / CONTROL_RATE

    @property
    def v_x(self) -> float:
        """Return the mean velocity [m/s] after the first 5 s, or of a walk of up to 5 s."""
        return walked_velocity(self.centers[:, 0])

    def __repr__(self) -> str:
        kinds = [kind for kind in ('spikes', 'values', 'poses') if getattr(self, kind) is not None]
        episode = f', episode {self.episode} of {self.n_episodes}' if self.n_episodes > 1 else ''
        return (
            f"Recording('{self.path}': {self.robot}, {len(self.voxel_names)} voxels, "
            f'{self.n_steps} steps, {self.times[-1]:.1f} s{episode}, v_x {self.v_x:.3f} m/s'
            f'{"".join(f", {kind}" for kind in kinds)})'
        )
