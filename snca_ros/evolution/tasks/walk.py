"""Walking to the right, the task of the paper (section 4.1)."""

from snca_ros.evolution.tasks.task import Episode, Task, mean_velocity


class Walk(Task):
    """The mean velocity of the centre of mass in x, after the transient."""

    quantity, unit = 'v_x', 'm/s'

    def score(self, episode: Episode, transient: float) -> float:
        """Return v_x [m/s]; that of the whole episode if it is not longer than the transient."""
        return mean_velocity(episode.centers[:, 0], transient)
