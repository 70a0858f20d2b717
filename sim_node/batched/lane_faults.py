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
        faults: faults of each robot; those of robots with the same ones are drawn once.
        n_sensors: sensors per voxel.

    Raises:
        InvalidInput: a voxel that is named in a fault does not exist.
    """

    def __init__(
        self, morphology: Morphology, faults: Sequence[FaultsOfBody], n_sensors: int
    ) -> None:
        self._lanes: dict[FaultsOfBody, list[int]] = {}
        for lane, own in enumerate(faults):
            self._lanes.setdefault(own, []).append(lane)
        self._robots = [BodyFaults(morphology, own, n_sensors) for own in self._lanes]
        self._width = len(faults)

    def draw(self, step: int, n: int) -> Disturbance:
        """Return what `BodyFaults.draw` returns for each robot, in lanes.

        Returns:
            Tables (n, n_voxels or 0, 1 or n_sensors, W), `actuators` with 1. A table has no voxels
            if no robot has such a fault.
        """
        drawn = [own.draw(step, n) for own in self._robots]
        return Disturbance(
            self._side_by_side([own.actuators[..., np.newaxis] for own in drawn], INTACT),
            self._side_by_side([own.noise for own in drawn], _NO_NOISE),
            self._side_by_side([own.sensors for own in drawn], INTACT),
        )

    def _side_by_side(self, tables: Sequence[np.ndarray], nothing: float) -> np.ndarray:
        """Return tables in lanes; those without voxels are filled with `nothing`."""
        largest = max(tables, key=lambda table: table.shape[1])
        found = np.full((*largest.shape, self._width), nothing)
        for table, lanes in zip(tables, self._lanes.values(), strict=True):
            if table.shape[1] > 0:
                found[..., lanes] = table[..., np.newaxis]
        return found
