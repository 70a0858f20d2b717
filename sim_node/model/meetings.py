"""Finds the control steps at which a robot meets the walls at both ends of the ground.

The ground is 2 km long, and behind either end of it stands a wall. A robot has met a wall when an
outer corner of a voxel is beyond the wall's foot. This is looked for at every `MARKER_PERIOD`-th
control step, those whose outlines are recorded, so that an episode and its recording agree.
"""

import numpy as np

from sim_node.control_time import MARKER_PERIOD
from sim_node.numerics.jit import compiled
from sim_node.walls import Walls

_NOT_MET = -1


def table_of_meetings(width: int) -> np.ndarray:
    """Return the table that `note_meetings` fills for `width` robots, (2, width)."""
    return np.full((2, width), _NOT_MET)


@compiled
def note_meetings(corners, feet, step, meetings):
    """Note the robots that meet a wall for the first time.

    Args:
        corners: (n_corners, 2, W) outer corners x, y [m] of the voxels of W robots.
        feet: (2,) x [m] of the feet of both walls, see `Terrain.feet_of_walls`.
        step: control step.
        meetings: (2, W) control steps at which the robots met the walls so far, written.
    """
    if step % MARKER_PERIOD != 0:
        return
    for i in range(corners.shape[0]):
        for lane in range(corners.shape[2]):
            if corners[i, 0, lane] < feet[0] and meetings[0, lane] == _NOT_MET:
                meetings[0, lane] = step
            if corners[i, 0, lane] > feet[1] and meetings[1, lane] == _NOT_MET:
                meetings[1, lane] = step


def walls_of(meetings: np.ndarray, n_steps: int) -> Walls:
    """Return the walls that a robot met in its `n_steps` control steps.

    Args:
        meetings: (2,) of one robot, filled by `note_meetings`.
        n_steps: number of its control steps before the physics diverged.
    """
    behind, ahead = (
        step if step != _NOT_MET and step <= n_steps else None for step in meetings.tolist()
    )
    return Walls(behind, ahead)


def walls_in_outlines(steps: np.ndarray, corners: np.ndarray, feet: np.ndarray) -> Walls:
    """Return the walls that a robot met, from its outlines.

    Args:
        steps: (n,) control steps of the outlines, increasing.
        corners: (n, n_voxels, 4, 2) outer corners x, y [m] of the voxels.
        feet: (2,) as of `note_meetings`.
    """
    due = steps % MARKER_PERIOD == 0
    steps, x = steps[due], corners[due, ..., 0]
    least, greatest = x.min(axis=(1, 2)), x.max(axis=(1, 2))
    behind, ahead = (
        int(steps[np.argmax(met)]) if met.any() else None
        for met in (least < feet[0], greatest > feet[1])
    )
    return Walls(behind, ahead)
