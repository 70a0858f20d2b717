"""Jumping: the highest rise of the centre of mass while no voxel touches the ground."""

import numpy as np

from snca_ros.evolution.tasks.task import Episode, Task, first_scored


class Jump(Task):
    """The highest rise of the centre of mass since the last contact with the ground.

    A robot that stands up, or climbs, touches the ground meanwhile, so this is no jump. In flight
    a robot cannot raise its centre of mass by changing its shape.
    """

    quantity, unit, records = 'rise', 'm', ('touching',)

    def score(self, episode: Episode, transient: float) -> float:
        """Return the rise [m] after the transient, from 0.

        It is measured until the robot meets the wall at the end of the ground.
        """
        y = episode.walls.free_part(episode.centers[:, 1])
        first = first_scored(len(y) - 1, transient)
        y, touching = y[first:], episode.records['touching'][first : len(y) - 1]
        contacts = np.where(touching.any(axis=1), np.arange(1, len(y)), 0)
        last_contact = np.maximum.accumulate([0, *contacts])
        return float((y - y[last_contact]).max())
