"""An episode of a robot with recorded arrays: readings, actuation, spikes, corners and others."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.errors import InvalidInput, check_name
from sim_node.model.sensors import DEFAULT_SENSORS
from snca_ros.evolution.episode import Episode

RECORDABLE = ('readings', 'actuation', 'spikes', 'values', 'corners', 'thresholds')
"""Names of the arrays that an episode records on request."""


@dataclass(frozen=True, eq=False, repr=False)
class RecordedEpisode(Episode):
    """One episode of a robot. Row k of an array belongs to control step k, `times[k]`.

    An episode has n_steps control steps of 1/60 s; fewer than requested if it diverged.

    Attributes:
        centers: (n_steps + 1, 2) centre of mass x, y [m].
        diverged: whether the physics became infinite or NaN before the end.
        name: of the robot.
        voxel_names: in the order of all arrays, row by row from the bottom.
        walls: the walls that the robot met; `walls.times` and `walls.ahead` say when.
        recorded: the requested arrays, by name; each is an attribute, too.
        sensors: names of the readings, in their order.
    """

    name: str
    voxel_names: tuple[str, ...]
    recorded: Mapping[str, np.ndarray | None]
    sensors: tuple[str, ...] = DEFAULT_SENSORS

    @property
    def times(self) -> np.ndarray:
        """Return the simulated time of each control step [s], (n_steps + 1,)."""
        return np.arange(len(self.centers)) / CONTROL_RATE

    @property
    def v_x(self) -> float:
        """Return the mean velocity [m/s] after the first 5 s, or of all of a shorter episode.

        It is measured until the robot meets the wall at the end of the ground, see `walls`. It is
        -inf if the episode diverged.
        """
        return self.velocity()

    @property
    def readings(self) -> np.ndarray:
        """Return what the voxels' sensors read, (n_steps + 1, n_voxels, n_sensors) in [0, 1].

        The columns are `sensors`.
        """
        return self._array('readings')

    @property
    def actuation(self) -> np.ndarray:
        """Return the cells' actuation, (n_steps, n_voxels) in [-1, 1]; 1 contracts, -1 expands.

        Row k acts from times[k] to times[k + 1].
        """
        return self._array('actuation')

    @property
    def applied(self) -> np.ndarray:
        """Return what moved the body: `actuation`, except where actuators are broken.

        It is recorded with `actuation`.
        """
        if 'applied' not in self.recorded:
            return self._array('actuation')
        return self._array('applied')

    @property
    def spikes(self) -> np.ndarray | None:
        """Return the spikes that the cells send, (n_steps, n_voxels, n_channels, 16), 0 or 1.

        None if the cells send none.
        """
        return self._found('spikes')

    @property
    def values(self) -> np.ndarray | None:
        """Return the values that the cells send, (n_steps, n_voxels, n_channels) in [-1, 1].

        None if the cells send none.
        """
        return self._found('values')

    @property
    def corners(self) -> np.ndarray:
        """Return the outer corners x, y of the voxels [m], (n_steps + 1, n_voxels, 4, 2)."""
        return self._array('corners')

    @property
    def thresholds(self) -> np.ndarray | None:
        """Return the mean threshold of each voxel's neurons [mV], (n_steps, n_voxels).

        None if the cells have none.
        """
        return self._found('thresholds')

    @property
    def heard(self) -> np.ndarray:
        """Return which spikes or values are known: all, (n_steps, n_voxels); see `Recording`."""
        return np.ones((len(self.centers) - 1, len(self.voxel_names)), dtype=bool)

    def _found(self, name: str) -> np.ndarray | None:
        if name not in self.recorded:
            raise InvalidInput('record', tuple(self.recorded), f'{name!r} among the names')
        return self.recorded[name]

    def _array(self, name: str) -> np.ndarray:
        found = self._found(name)
        assert found is not None
        return found

    def __repr__(self) -> str:
        events = [*(['diverged'] if self.diverged else []), *self.walls.describe()]
        kinds = [name for name in RECORDABLE if self.recorded.get(name) is not None]
        return (
            f"RecordedEpisode('{self.name}', {self.times[-1]:.1f} s, v_x {self.v_x:.3f} m/s"
            f'{"".join(f", {one}" for one in [*events, *kinds])})'
        )


def names_to_record(record: str | Iterable[str]) -> tuple[str, ...]:
    """Return the names of `RECORDABLE` that `record` requests.

    Args:
        record: names, one name, or 'all'.

    Raises:
        InvalidInput: a name is not in `RECORDABLE`.
    """
    if record == 'all':
        return RECORDABLE
    names = (record,) if isinstance(record, str) else tuple(record)
    for name in names:
        check_name('record', name, [*RECORDABLE, 'all'])
    return names
