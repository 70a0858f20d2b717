"""What a robot looks like at some moments of a walk: of a controller, or of a bag."""

import functools
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.typesys import Stores, get_typestore

from sim_node.errors import InvalidInput
from sim_node.render import area_colors
from sim_node.simulation import Diverged, Simulation
from sim_node.stamps import CONTROL_RATE
from sim_node.terrain import Terrain
from snca_ros.controller_file import TrainedController
from snca_ros.study.bag import robot_of
from snca_ros.study.storage import Topic, read_storage
from snca_ros.study.streams import Stream, decode

_MARKERS = 'visualization_msgs/msg/MarkerArray'
_CORNERS = [0, 1, 2, 5]
"""Of the two triangles of a voxel, the points that are its corners, in their order."""


@dataclass(frozen=True, eq=False)
class Film:
    """A robot at some moments of its walk.

    Attributes:
        times: (n_frames,) [s].
        centers: (n_frames, 2) centre of mass [m].
        corners: (n_frames, n_voxels, 4, 2) outer corners of the voxels [m].
        colors: (n_frames, n_voxels, 4) RGBA in [0, 1].
        terrain: the ground.
    """

    times: np.ndarray
    centers: np.ndarray
    corners: np.ndarray
    colors: np.ndarray
    terrain: Terrain


def shoot(trained: TrainedController, terrain: str, moments: np.ndarray) -> Film:
    """Let the robot walk and keep what it looks like at `moments` [s], which increase.

    Raises:
        InvalidInput: the terrain is unknown, or the physics diverges with this controller.
    """
    simulation = Simulation(
        trained.morphology, terrain,
        material=trained.material, solver=trained.solver, engine=trained.chosen_by,
    )
    controller = trained.controller()
    readings = simulation.reset()
    times, centers, corners, area_ratios = [], [], [], []
    for wanted in np.round(moments * CONTROL_RATE).astype(int):
        while simulation.step_count < wanted:
            try:
                readings = simulation.step(controller.step(readings))
            except Diverged as error:
                raise InvalidInput('controller', str(error), 'a walk that stays finite') from None
        times.append(simulation.time)
        centers.append(simulation.center)
        corners.append(simulation.world.corners.copy())
        area_ratios.append(simulation.world.area_ratios.copy())
    return Film(
        np.array(times), np.array(centers), np.array(corners),
        np.array([area_colors(ratios) for ratios in area_ratios]), simulation.terrain,
    )


def read_film(path: Path, moments: np.ndarray) -> Film:
    """Return what the robot of a bag looked like at `moments` [s] of its last episode.

    Markers are shown until the next come, a 30th of a second later. A film ends with its bag.

    Args:
        path: of the bag.
        moments: [s], increasing.

    Raises:
        InvalidInput: there is no bag, it has no markers of a robot, or ends before all moments.
    """
    topics, _ = read_storage(path)
    try:
        return _recorded(topics, robot_of(topics), moments)
    except InvalidInput as error:
        raise error.found_in(str(path)) from None


def _recorded(topics: dict[str, Topic], robot: str, moments: np.ndarray) -> Film:
    odometry, since = _last_episode(topics, f'/{robot}/odometry')
    markers = topics.get(f'/{robot}/markers')
    if markers is None or markers.type != _MARKERS:
        raise InvalidInput(f'/{robot}/markers', markers and markers.type, _MARKERS)
    wanted = np.round(moments * CONTROL_RATE)
    wanted = wanted[wanted <= odometry.steps[-1]]
    if not len(wanted):
        end = odometry.steps[-1] / CONTROL_RATE
        raise InvalidInput('start', moments[0], f'at most {end:.2f} s, the end of the walk')
    shown = _holding('voxels', markers, since)
    at = _belonging(odometry, markers.times[shown])
    chosen = np.searchsorted(odometry.steps[at], wanted, side='right') - 1
    chosen = np.maximum(chosen, 0)
    voxels = [_marker('voxels', markers, i) for i in shown[chosen]]
    n = len(voxels[0].points) // 6 * 6
    points = np.array([_points(marker, n) for marker in voxels])
    colors = np.array([_colors(marker, n) for marker in voxels])
    ground = _marker('ground', markers, _holding('ground', markers, since)[0])
    return Film(
        wanted / CONTROL_RATE,
        odometry.numbers[at[chosen]],
        points.reshape(len(wanted), -1, 6, 2)[:, :, _CORNERS],
        colors[:, ::6],
        Terrain('recorded', *_points(ground, len(ground.points)).T),
    )


def _last_episode(topics: dict[str, Topic], name: str) -> tuple[Stream, int]:
    """Return the odometry of the last episode, and when that began [ns], 0 if it is the only."""
    odometry = decode(name, topics[name], 'odometry')
    first = odometry.starts()[-1]
    last = Stream(odometry.steps[first:], odometry.times[first:], odometry.numbers[first:])
    return last, int(last.times[0]) if first else 0


def _holding(namespace: str, markers: Topic, since: int) -> np.ndarray:
    """Return the numbers of the messages that have markers of a namespace, from a time [ns] on."""
    text = f'{namespace}\0'.encode()
    found = [
        i for i, data in enumerate(markers.messages) if markers.times[i] >= since and text in data
    ]
    if not found:
        raise InvalidInput('markers', f'none of {namespace}', 'those that the simulation sends')
    return np.array(found)


def _belonging(odometry: Stream, times: np.ndarray) -> np.ndarray:
    """Return the index of the odometry that belongs to each message of markers.

    Those have no stamp, but come every other step. If any of either is missing, the odometry
    last recorded before them is taken.

    Args:
        odometry: of the episode.
        times: when the messages of markers were recorded [ns].
    """
    n = len(odometry.steps)
    if odometry.steps[-1] == n - 1 and len(times) == (n + 1) // 2:
        return np.arange(0, n, 2)
    return np.maximum(np.searchsorted(odometry.times, times, 'right') - 1, 0)


def _marker(namespace: str, markers: Topic, i: int) -> Any:
    """Return the marker of a namespace in message `i`."""
    try:
        message = _types().deserialize_cdr(markers.messages[i], _MARKERS)
        return next(marker for marker in message.markers if marker.ns == namespace)
    except Exception as error:  # what rosbags says about bytes of another layout
        raise InvalidInput('markers', ' '.join(str(error).split()), _MARKERS) from None


def _points(marker: Any, n: int) -> np.ndarray:
    """Return the points of a marker in the plane of the robot, (n, 2) [m]."""
    return _finite('points', [(p.x, p.z) for p in marker.points], (n, 2))


def _colors(marker: Any, n: int) -> np.ndarray:
    """Return the colours of a marker's points, (n, 4) RGBA."""
    return _finite('colors', [(c.r, c.g, c.b, c.a) for c in marker.colors], (n, 4))


def _finite(name: str, rows: list[tuple[float, ...]], shape: tuple[int, int]) -> np.ndarray:
    found = np.array(rows, dtype=float)
    if not rows or found.shape != shape or not (np.abs(found) < 1e6).all():
        raise InvalidInput(name, f'{len(rows)} in a marker', f'{shape[0]} finite ones')
    return found


@functools.cache
def _types():
    return get_typestore(Stores.ROS2_JAZZY)
