"""The newest actuation received from each voxel, and which voxels have not answered."""

from collections.abc import Sequence

import numpy as np

from sim_node.ros.delivery import Delivery


class Answers:
    """The newest actuation of each voxel, and which voxels have not answered yet.

    Args:
        voxels: names of the voxels.
        hold: True if a voxel that does not answer in time holds its last actuation until it counts
            as silent; False if only answers to the present step are applied.

    Attributes:
        silent: names of the voxels that count as silent: no step waits for them, and their
            actuation is 0.
        deliveries: delivery statistics of each voxel.
        actuation: (n_voxels,) the newest actuation of each voxel.
        awaited: (n_voxels,) bool, whose answer to the present step has not come.
    """

    def __init__(self, voxels: Sequence[str], hold: bool) -> None:
        self._voxels, self._hold = voxels, hold
        self.silent: set[str] = set()
        self.deliveries = [Delivery() for _ in voxels]
        self.actuation = np.zeros(len(voxels))
        self.awaited = np.zeros(len(voxels), dtype=bool)
        self.restart(0.0)

    def restart(self, now: float) -> None:
        """Begin an episode at time `now` [s]: clear everything but `silent`."""
        self.actuation[:] = 0.0
        self._newest = np.full(len(self._voxels), -1)
        for delivery in self.deliveries:
            delivery.restart()
        self.restart_timeouts(now)

    def restart_timeouts(self, now: float) -> None:
        """Restart the silence timeout of every voxel, at the start and after a pause."""
        self._last_answer = [now] * len(self._voxels)

    def open_step(self) -> None:
        """Begin to wait for the answers of all voxels to a new step."""
        self.awaited[:] = True

    @property
    def complete(self) -> bool:
        """Return whether all voxels but the silent ones have answered to the present step."""
        return not (self.missing if self.silent else np.count_nonzero(self.awaited))

    @property
    def missing(self) -> list[str]:
        """Return the voxels that have not answered to the present step, without the silent ones."""
        awaited = np.flatnonzero(self.awaited).tolist()
        return [self._voxels[i] for i in awaited if self._voxels[i] not in self.silent]

    def take(self, i: int, sent: int, a: float, step: int, now: float) -> bool:
        """Store an actuation that was received; return whether it is in time.

        Args:
            i: index of the voxel.
            sent: the step whose sensors it answers.
            a: the actuation.
            step: the present step.
            now: the time [s].
        """
        in_time = sent == step and bool(self.awaited[i])
        if in_time:
            self.awaited[i] = False
        else:
            self.deliveries[i].note_late(sent)
        if in_time or (self._hold and sent > self._newest[i]):
            self.actuation[i], self._newest[i], self._last_answer[i] = a, sent, now
            self.silent.discard(self._voxels[i])
        return in_time

    def note(self, i: int, step: int, now: float) -> None:
        """Record that the caller has written an awaited answer into `actuation` and `awaited`."""
        self._newest[i], self._last_answer[i] = step, now
        self.silent.discard(self._voxels[i])

    def close_step(self, step: int) -> np.ndarray:
        """Return the actuation to apply in this step, (n_voxels,) in [-1, 1]."""
        for i, (voxel, delivery) in enumerate(zip(self._voxels, self.deliveries, strict=True)):
            delivery.close_step(step, not self.awaited[i])
            if voxel in self.silent:
                self.actuation[i] = 0.0
        return self.actuation

    def ages(self, step: int) -> np.ndarray:
        """Return the ages in steps of the answers that `close_step` returned, (n_voxels,).

        The age is 0 if the answer to this step came in time, n > 0 if the voxel holds its answer to
        the step n steps before, and -1 if it is limp: no answer counts, and its actuation is 0.
        """
        limp = self._newest < 0
        if self.silent:
            limp |= [voxel in self.silent for voxel in self._voxels]
        return np.where(limp, -1, step - self._newest)

    def mark_silent(self, now: float, limit: float) -> list[str]:
        """Add the voxels without an answer for more than `limit` seconds to `silent`.

        Returns:
            Names of the voxels that were added.
        """
        added = [
            voxel for voxel, time in zip(self._voxels, self._last_answer, strict=True)
            if now - time > limit and voxel not in self.silent
        ]
        self.silent.update(added)
        return added
