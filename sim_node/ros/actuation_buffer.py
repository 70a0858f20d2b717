"""What the voxels have answered to their sensors: the actuation that moves the body."""

from collections.abc import Sequence

import numpy as np

from sim_node.ros.delivery import Link


class Answers:
    """The newest actuation of each voxel, and who has not answered yet.

    Args:
        voxels: names of the voxels.
        hold: a voxel that does not answer in time holds its last actuation, until it is silent;
            else only answers to the present step count.

    Attributes:
        silent: names of the voxels that nobody waits for; they are limp.
        links: one per voxel, accounts of what came.
    """

    def __init__(self, voxels: Sequence[str], hold: bool) -> None:
        self._voxels, self._hold = voxels, hold
        self.silent: set[str] = set()
        self.links = [Link() for _ in voxels]
        self._actuation = np.zeros(len(voxels))
        self._awaited: dict[int, str] = {}
        self.restart(0.0)

    def restart(self, now: float) -> None:
        """Forget everything but who is silent: an episode begins."""
        self._actuation[:] = 0.0
        self._newest = [-1] * len(self._voxels)
        for link in self.links:
            link.restart()
        self.renew(now)

    def renew(self, now: float) -> None:
        """Let nobody have been silent for long: time begins to run, or goes on after a pause."""
        self._heard = [now] * len(self._voxels)

    def open_step(self) -> None:
        """Begin to wait for the answers to a new step."""
        self._awaited = dict(enumerate(self._voxels))

    @property
    def missing(self) -> list[str]:
        """Return the voxels, but for the silent, that have not answered to the present step."""
        return [voxel for voxel in self._awaited.values() if voxel not in self.silent]

    def take(self, i: int, sent: int, a: float, step: int, now: float) -> bool:
        """Take voxel i's actuation of step `sent`; return whether it came in time.

        Args:
            i: index of the voxel.
            sent: the step that it answers.
            a: its actuation.
            step: the present step.
            now: the time [s].
        """
        in_time = sent == step and i in self._awaited
        if in_time:
            del self._awaited[i]
        else:
            self.links[i].note_late(sent)
        if in_time or (self._hold and sent > self._newest[i]):
            self._actuation[i], self._newest[i], self._heard[i] = a, sent, now
            self.silent.discard(self._voxels[i])
        return in_time

    def close_step(self, step: int) -> np.ndarray:
        """Return the actuation that acts in this step, (n_voxels,) in [-1, 1]."""
        for i, (voxel, link) in enumerate(zip(self._voxels, self.links, strict=True)):
            link.close_step(step, i not in self._awaited)
            if voxel in self.silent:
                self._actuation[i] = 0.0
        return self._actuation

    def let_go(self, now: float, limit: float) -> list[str]:
        """Take those for silent that were last heard more than `limit` seconds ago; name them."""
        fallen = [
            voxel for voxel, heard in zip(self._voxels, self._heard, strict=True)
            if now - heard > limit and voxel not in self.silent
        ]
        self.silent.update(fallen)
        return fallen
