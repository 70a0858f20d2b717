"""Episodes of several controllers side by side in the batched engine, with one robot each."""

import functools
from collections.abc import Sequence
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from sim_node.batched.engine import Robots, advance_group
from sim_node.control_time import steps_in
from sim_node.errors import InvalidInput
from sim_node.model.body_faults import Disturbance, break_values, disturb_readings
from sim_node.model.meetings import note_meetings, table_of_meetings, walls_of
from sim_node.model.morphology import Morphology, parse_morphology
from sim_node.model.terrain import parse_terrain
from sim_node.numerics.jit import compiled
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cell_lanes import make_cells, step_group, step_group_faulty
from snca_ros.cell.lane_faults import LaneFaults
from snca_ros.evolution.conditions import Conditions
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import EPISODE, Episode, Records, record
from snca_ros.evolution.fault_lanes import CellFaultsInLanes
from snca_ros.evolution.tasks import check_task
from snca_ros.faults import NO_FAULTS, Faults

STEPS_DRAWN = 1800
"""Control steps for which faults are drawn at once, so that their tables stay small."""


class EpisodeFaults(NamedTuple):
    """The faults of W robots at some control steps, one row per step."""

    bodies: Disturbance
    cells: LaneFaults


@compiled
def _walk(
    group, sensing, cells, first, last, centers, done, records, corners, feet_of_walls, meetings,
    faults,
):
    """Run episodes of W robots from control step `first` up to, not including, `last`.

    If `records` or `faults` is None, their code is not compiled.

    Args:
        centers: (n_steps + 1, 2, W) centres of mass [m], written.
        done: (W,) number of steps before the physics diverged, written; 0 at step 0.
        corners, feet_of_walls, meetings: see `note_meetings`.
        faults: `EpisodeFaults`, from step `first` on.
        The other arguments are the parts of robots and cells.
    """
    if first == 0:
        _write_centers(group.mass_lanes, centers[0])
    for k in range(first, last):
        if faults is None:
            step_group(cells, sensing.readings, k, group.actuation)
            advance_group(group, sensing, k + 1)
        else:
            row, acted = k - first, group.actuation_lanes.copy()
            step_group_faulty(cells, sensing.readings, k, group.actuation, faults.cells, row)
            break_values(group.actuation_lanes, faults.bodies.actuators[row], acted)
            before = sensing.reading_lanes.copy()
            advance_group(group, sensing, k + 1)
            disturb_readings(sensing.reading_lanes, before, faults.bodies, row)
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
    pushes: int | Sequence[int] | None = None,
    faults: Faults | Sequence[Faults] = NO_FAULTS,
    records: tuple[str, ...] = (),
) -> list[Episode]:
    """Run one episode of each of up to W controllers, side by side.

    Args:
        robots: W robots of that morphology; they are reset.
        architecture: architecture of the controllers' cells.
        morphology: morphology of the robots.
        candidates: (n, n_parameters) parameters of n <= W controllers. In other lanes they are 0.
        duration: duration of the episodes [s].
        pushes: start of each robot, or of all, see `Robots.reset`.
        faults: faults of each of the n robots, or of all.
        records: names of arrays to record, see `run_episode`.

    Returns:
        One episode per controller, which does not depend, to the bit, on the other controllers,
        starts and faults.

    Raises:
        InvalidInput: the candidates do not fit, see `make_cells`; there are not as many faults as
            candidates; a voxel that is named in a fault does not exist.
    """
    width = robots.sensing.reading_lanes.shape[2]
    n_steps = steps_in(duration)
    cells = make_cells(architecture, morphology, candidates, width)
    own = [faults] * len(candidates) if isinstance(faults, Faults) else [*faults]
    if len(own) != len(candidates):
        raise InvalidInput('faults', len(own), f'those of {len(candidates)} candidates')
    own += [NO_FAULTS] * (width - len(own))
    centers = np.empty((n_steps + 1, 2, width))
    done = np.zeros(width, dtype=np.int64)
    robots.reset(pushes, own)
    recorded = Records.of(records, _world(robots), n_steps, morphology, robots.material)
    meetings = table_of_meetings(width)

    def walk(first: int, last: int, drawn: EpisodeFaults | None) -> None:
        _walk(
            robots.group, robots.sensing, cells, first, last, centers, done, recorded,
            robots.group.corners['lane'], robots.feet_of_walls, meetings, drawn,
        )
        robots.step_count = last

    if any(faults_of_one.any for faults_of_one in own):
        of_cells = CellFaultsInLanes(own, architecture, morphology)
        for first in range(0, n_steps, STEPS_DRAWN):
            n = min(STEPS_DRAWN, n_steps - first)
            drawn = EpisodeFaults(robots.disturbance(n), of_cells.tables(first, n))
            walk(first, first + n, drawn)
    else:
        walk(0, n_steps, None)
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
        self._robots = functools.lru_cache(maxsize=64)(self._make_robots)

    def __call__(
        self, candidates: np.ndarray, width: int, duration: float, conditions: Conditions
    ) -> list[Episode]:
        """Return an episode of each of (n, n_parameters) candidates, n <= `width`."""
        robots = self._robots(conditions.shape, conditions.terrain, width)
        return run_episodes(
            robots, self._config.architecture, parse_morphology(conditions.shape), candidates,
            duration, conditions.push, conditions.faults, self._records,
        )

    def _make_robots(self, shape: str, terrain: str, width: int) -> Robots:
        return Robots(
            parse_morphology(shape), parse_terrain(terrain), self._config.material,
            self._config.solver, width, sensors=self._config.architecture.sensors,
        )
