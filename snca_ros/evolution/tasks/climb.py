"""Climbing: the distance up a staircase whose steps become higher."""

from snca_ros.evolution.tasks.task import Episode, Task


class Climb(Task):
    """The distance in x between the start of the episode and its end.

    It is measured from the start, since a robot that has climbed steps in the transient has the
    higher ones ahead of it. A robot that falls back loses distance.
    """

    quantity, unit, terrain = 'distance', 'm', 'stairs-0.1-10'

    def score(self, episode: Episode, transient: float) -> float:
        """Return the distance [m], until the robot meets the wall at the end of the ground."""
        x = episode.walls.free_part(episode.centers[:, 0])
        return float(x[-1] - x[0])
