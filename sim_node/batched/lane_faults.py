"""Faults of the bodies of W robots: sensor noise, broken sensors and broken actuators in lanes."""

from collections.abc import Sequence

import numpy as np

from sim_node.model.body_faults import INTACT, BodyFaults, Disturbance, FaultsOfBody
from sim_node.model.morphology import Morphology

_NO_NOISE = -0.0  # x + -0.0 is x, also for x = -0.0


class BodyFaultsInLanes:
    """The faults of the bodies of W robots, drawn step by step; see `BodyFaults` of one robot.

    Args:
        morphology: morphology of the robots.
        faults: faults of each robot.
        n_sensors: sensors per voxel.

    Raises:
        InvalidInput: a voxel that is named in a fault does not exist.
    """

    def __init__(
        self, morphology: Morphology, faults: Sequence[FaultsOfBody], n_sensors: int
    ) -> None:
        self._robots = [BodyFaults(morphology, own, n_sensors) for own in faults]

    def draw(self, step: int, n: int) -> Disturbance:
        """Return what `BodyFaults.draw` returns for each robot, in lanes.

        Returns:
            Tables (n, n_voxels or 0, 1 or n_sensors, W), `actuators` with 1. A table has no voxels
            if no robot has such a fault.
        """
        actuators, noise, sensors = zip(*(own.draw(step, n) for own in self._robots), strict=True)
        return Disturbance(
            _side_by_side([table[..., np.newaxis] for table in actuators], INTACT),
            _side_by_side(noise, _NO_NOISE),
            _side_by_side(sensors, INTACT),
        )


def _side_by_side(tables: Sequence[np.ndarray], nothing: float) -> np.ndarray:
    """Return tables as lanes of one; those without voxels are filled with `nothing`."""
    largest = max(tables, key=lambda table: table.shape[1])
    lanes = np.full((*largest.shape, len(tables)), nothing)
    for lane, table in enumerate(tables):
        if table.shape[1] > 0:
            lanes[..., lane] = table
    return lanes
