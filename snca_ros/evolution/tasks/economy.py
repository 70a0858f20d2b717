"""Economy: the metres that a robot walks for each joule of its actuators."""

import numpy as np

from snca_ros.evolution.tasks.task import Episode, Task, first_scored

FLOOR = 0.1
"""The least v_x [m/s] of a robot that scores anything."""


class Economy(Task):
    """The distance in x after the transient over the positive work of the actuators.

    A voxel has one actuator, which moves all of its springs by one signal. So energy that some of
    them release while it works on others is used; but what it would take back from all of them
    together in a control step is lost: negative work counts as 0. The work of the transient counts,
    too, since a robot could live on it afterwards.
    """

    quantity, unit, records = 'economy', 'm/kJ', ('work',)

    def score(self, episode: Episode, transient: float) -> float:
        """Return the economy [m/kJ]; 0 if v_x is below `FLOOR`, or the actuators do no work.

        As v_x, it is measured until the robot meets the wall at the end of the ground.
        """
        x = episode.walls.free_part(episode.centers[:, 0])
        work = np.maximum(episode.records['work'][: len(x) - 1], 0.0).sum()
        if work == 0.0 or episode.velocity(transient) < FLOOR:
            return 0.0
        return float((x[-1] - x[first_scored(len(x) - 1, transient)]) / (1e-3 * work))
