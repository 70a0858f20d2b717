"""Episodes of several controllers side by side in the batched engine, with one robot each."""

import functools
from types import SimpleNamespace

import numpy as np

from sim_node.batched.engine import Robots, advance_group
from sim_node.control_time import steps_in
from sim_node.model.meetings import note_meetings, table_of_meetings, walls_of
from sim_node.model.morphology import Morphology, parse_morphology
from sim_node.model.terrain import parse_terrain
from sim_node.numerics.jit import compiled
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cell_lanes import make_cells, step_group
from snca_ros.evolution.conditions import Conditions
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import EPISODE, Episode, Records, record
from snca_ros.evolution.tasks import check_task


@compiled
def _walk(group, sensing, cells, centers, done, records, corners, feet_of_walls, meetings):
    """Run episodes of W robots.

    If `records` is None, its code is not compiled.

    Args:
        centers: (n_steps + 1, 2, W) centres of mass [m], written.
        done: (W,) number of steps before the physics diverged, written; 0 on entry.
        corners, feet_of_walls, meetings: see `note_meetings`.
        The other arguments are the parts of robots and cells.
    """
    _write_centers(group.mass_lanes, centers[0])
    for k in range(centers.shape[0] - 1):
        step_group(cells, sensing.readings, k, group.actuation)
        advance_group(group, sensing, k + 1)
        _write_centers(group.mass_lanes, centers[k + 1])
        note_meetings(corners, feet_of_walls, k + 1, meetings)
        if records is not None:
            record(records, k)
        for lane in range(done.shape[0]):
            if done[lane] == k and sensing.sane_lanes[0, 0, lane] > 0.0:
                done[lane] = k + 1


@compiled
def _write_centers(mass_lanes, centers):
    """Write the robots' centres of mass, (2, W) [m], from `Group.mass_lanes`."""
    n = mass_lanes.shape[0]
    for axis in range(2):
        for lane in range(centers.shape[1]):
            total = 0.0
            for i in range(n):
                total += mass_lanes[i, axis, lane]
            centers[axis, lane] = total / n


def run_episodes(
    robots: Robots,
    architecture: Architecture,
    morphology: Morphology,
    candidates: np.ndarray,
    duration: float = EPISODE,
    push: int | None = None,
    records: tuple[str, ...] = (),
) -> list[Episode]:
    """Run one episode of each of up to W controllers, side by side.

    Args:
        robots: W robots of that morphology; they are reset.
        architecture: architecture of the controllers' cells.
        morphology: morphology of the robots.
        candidates: (n, n_parameters) parameters of n <= W controllers. In other lanes they are 0.
        duration: duration of the episodes [s].
        push: start of the robots, see `Robots.reset`.
        records: names of arrays to record, see `run_episode`.

    Returns:
        One episode per controller, which does not depend, to the bit, on the other controllers.
    """
    width = robots.sensing.reading_lanes.shape[2]
    n_steps = steps_in(duration)
    cells = make_cells(architecture, morphology, candidates, width)
    centers = np.empty((n_steps + 1, 2, width))
    done = np.zeros(width, dtype=np.int64)
    robots.reset(push)
    recorded = Records.of(records, _world(robots), n_steps, morphology, robots.material)
    meetings = table_of_meetings(width)
    _walk(
        robots.group, robots.sensing, cells, centers, done, recorded,
        robots.group.corners['lane'], robots.feet_of_walls, meetings,
    )
    robots.step_count = n_steps
    rows = recorded.rows if recorded else ()
    return [
        Episode(
            centers[: n + 1, :, lane], diverged=n < n_steps, walls=walls_of(meetings[:, lane], n),
            records={name: of_it[:n, :, lane] for name, of_it in zip(records, rows, strict=True)},
        )
        for lane, n in enumerate(done[: len(candidates)].tolist())
    ]


def _world(robots: Robots) -> SimpleNamespace:
    """Return the arrays that `Records` take, with the lanes as their last axis."""
    group = robots.group
    names = 'actuation', 'area_ratios', 'touching'
    lanes = {name: getattr(group, name)['lane'][:, 0] for name in names}
    return SimpleNamespace(masses=group.mass_lanes, **lanes)


class SideBySide:
    """Runs episodes of candidates side by side in the batched engine, one candidate per lane.

    Args:
        config: configuration of the run.
    """

    def __init__(self, config: RunConfig) -> None:
        self._config, self._records = config, check_task(config.task).records
        self._robots = functools.lru_cache(maxsize=8)(self._make_robots)

    def __call__(
        self, candidates: np.ndarray, width: int, duration: float, conditions: Conditions
    ) -> list[Episode]:
        """Return an episode of each of (n, n_parameters) candidates, n <= `width`."""
        robots = self._robots(conditions.shape, conditions.terrain, width)
        return run_episodes(
            robots, self._config.architecture, parse_morphology(conditions.shape), candidates,
            duration, conditions.push, self._records,
        )

    def _make_robots(self, shape: str, terrain: str, width: int) -> Robots:
        return Robots(
            parse_morphology(shape), parse_terrain(terrain), self._config.material,
            self._config.solver, width, sensors=self._config.architecture.sensors,
        )
