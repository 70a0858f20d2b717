"""Walking to the right, the task of the paper (section 4.1)."""

from snca_ros.evolution.tasks.task import Episode, Task


class Walk(Task):
    """The mean velocity of the centre of mass in x, after the transient.

    It is measured until the robot meets the wall at the end of the ground. The wall behind its
    start is part of the course: a robot that walks backwards is held by it.
    """

    quantity, unit = 'v_x', 'm/s'

    def score(self, episode: Episode, transient: float) -> float:
        """Return v_x [m/s]; that of the whole episode if it is not longer than the transient."""
        return episode.velocity(transient)
