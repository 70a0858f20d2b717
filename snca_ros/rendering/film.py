"""Films: voxel outlines and colours of a robot at given times of an offline walk or of a bag."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim_node.control_time import CONTROL_RATE, steps_in
from sim_node.drawing import area_colors
from sim_node.errors import InvalidInput
from sim_node.model.terrain import Terrain
from sim_node.walls import Walls
from snca_ros.recording.bag import Recording, read_bag
from snca_ros.recording.gait import area_ratios, bridge_gaps
from snca_ros.recording.offline import record_offline
from snca_ros.recording.outcomes import Outcome
from snca_ros.trained_controller import TrainedController

LIMP = 0.35, 0.3, 0.35, 1.0
"""RGBA of a limp voxel, which no answer of its node moves."""

_FAR = 1e6  # m; larger coordinates cannot be drawn


@dataclass(frozen=True, eq=False)
class Film:
    """Outlines and colours of a robot's voxels at some times of a walk.

    Attributes:
        times: (n_frames,) [s].
        centers: (n_frames, 2) centre of mass [m].
        corners: (n_frames, n_voxels, 4, 2) outer corners of the voxels [m].
        colors: (n_frames, n_voxels, 4) RGBA in [0, 1], from the area that each voxel senses, or
            `LIMP`.
        terrain: the ground.
        walls: walls that the robot met in the whole walk.
    """

    times: np.ndarray
    centers: np.ndarray
    corners: np.ndarray
    colors: np.ndarray
    terrain: Terrain
    walls: Walls


def film_offline(trained: TrainedController, terrain: str, moments: np.ndarray) -> Film:
    """Simulate a walk and return its film.

    Args:
        trained: the controller.
        terrain: name of the terrain.
        moments: times of the frames [s], increasing.

    Raises:
        InvalidInput: the terrain is unknown, or the physics diverges with this controller.
    """
    # One step more than is shown: the readings of a step are those at its beginning.
    recording, _ = record_offline(
        trained, Path(), (steps_in(moments[-1]) + 1) / CONTROL_RATE, terrain
    )
    return film_recording(recording, moments)


def film_bag(path: Path, moments: np.ndarray) -> Film:
    """Return the film of the last episode of a bag.

    Args:
        path: of the bag.
        moments: times of the frames [s], increasing.

    Raises:
        InvalidInput: there is no bag, it has no markers of a robot, or ends before all moments.
    """
    try:
        return film_recording(read_bag(path), moments)
    except InvalidInput as error:
        raise error.found_in(str(path)) from None


def film_recording(recording: Recording, moments: np.ndarray) -> Film:
    """Return the film of a recording.

    A frame shows the latest pose; a bag has 30 poses per second. The film ends with the recording.

    Args:
        recording: of a bag or of `record_offline`.
        moments: times of the frames [s], increasing.

    Raises:
        InvalidInput: there are no poses, or they are out of range, or the recording ends before all
            moments.
    """
    poses = recording.poses
    if poses is None:
        raise InvalidInput('markers', None, f'markers on /{recording.robot}/markers')
    wanted = np.array([steps_in(moment) for moment in moments])
    wanted = wanted[wanted < recording.n_steps]
    if not len(wanted):
        end = (recording.n_steps - 1) / CONTROL_RATE
        raise InvalidInput('start', moments[0], f'at most {end:.2f} s, the end of the walk')
    shown = np.maximum(np.searchsorted(poses.steps, wanted, side='right') - 1, 0)
    corners, steps = poses.corners[shown], poses.steps[shown]
    if not (np.abs(corners) < _FAR).all() or not (np.abs(poses.ground) < _FAR).all():
        raise InvalidInput('markers', 'coordinates far away or NaN', f'within {_FAR:g} m')
    ratios = area_ratios(bridge_gaps(recording.readings)[steps], recording.sensors)
    colors = area_colors(ratios if 'area' in recording.sensors else np.ones(ratios.shape))
    colors[recording.outcomes[steps] == Outcome.LIMP] = LIMP
    return Film(
        wanted / CONTROL_RATE, bridge_gaps(recording.centers)[steps], corners, colors,
        Terrain('recorded', *poses.ground.T), recording.walls,
    )
