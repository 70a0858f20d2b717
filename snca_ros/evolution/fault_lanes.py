"""The faults of the cells of several robots, as tables for episodes side by side."""

from collections.abc import Callable, Sequence

import numpy as np

from sim_node.model.morphology import DIRECTIONS, Morphology
from sim_node.numerics.lane_array import zeros
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.coding import SNN_STEPS
from snca_ros.cell.lane_faults import LaneFaults
from snca_ros.faults import CellFaults, Faults


class CellFaultsInLanes:
    """The faults of the cells and messages of W robots of one shape, from control step 0 on.

    Args:
        faults: faults of each robot; those of robots with the same ones are drawn once.
        architecture: architecture of the cells.
        morphology: morphology of the robots.

    Raises:
        InvalidInput: a voxel named in `death` does not exist.
    """

    def __init__(
        self, faults: Sequence[Faults], architecture: Architecture, morphology: Morphology
    ) -> None:
        n, width = morphology.n_voxels, len(faults)
        self._robots = [
            (CellFaults(own, morphology), _mask([own == other for other in faults]))
            for own in dict.fromkeys(faults)
        ]
        self._voxels = range(n)
        delays = [own.delay for own in faults]
        self._delays = np.unique(delays)
        self._delayed = np.array([_mask(np.equal(delays, delay)) for delay in self._delays])
        n_sent, n_slots = architecture.n_destinations * architecture.n_c, max(delays) + 1
        of_trains, of_values = (n_slots, 1) if architecture.spiking else (1, n_slots)
        self._trains = np.zeros((of_trains, n, n_sent, SNN_STEPS), dtype=np.int64)
        self._values = zeros((of_values * n, n_sent), width)
        self._born = np.zeros((n, width), dtype=np.int64)

    def tables(self, first: int, n_steps: int) -> LaneFaults:
        """Return the faults at `n_steps` control steps from `first` on."""
        return LaneFaults(
            lost=self._table(CellFaults.lost, first, n_steps, (len(DIRECTIONS),)),
            dead=self._table(CellFaults.dead, first, n_steps, ()),
            delays=self._delays,
            delayed=self._delayed,
            ring_of_trains=self._trains,
            ring_of_values=self._values,
            born=self._born,
        )

    def _table(
        self, of_voxel: Callable, first: int, n_steps: int, shape: tuple[int, ...]
    ) -> np.ndarray:
        """Return the masks of a fault that `of_voxel` gives, (n_steps, n_voxels, *shape)."""
        table = np.zeros((n_steps, len(self._voxels), *shape), dtype=np.int64)
        for own, robots in self._robots:
            if own.any:
                found = [of_voxel(own, i, first, n_steps) for i in self._voxels]
                table |= np.where(np.stack(found, axis=1), robots, 0)
        return table


def _mask(lanes: Sequence[bool] | np.ndarray) -> np.int64:
    """Return (W,) bool as a mask, whose bit i is the robot in lane i."""
    return (np.asarray(lanes, dtype=np.int64) << np.arange(len(lanes))).sum()
