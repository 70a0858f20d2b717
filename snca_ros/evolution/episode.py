"""Episodes of one robot: its centre of mass and the records of a task at each control step."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from sim_node.control_time import steps_in
from sim_node.engine import Engine, RobotArrays
from sim_node.errors import check_name
from sim_node.model.material import Material
from sim_node.model.meetings import note_meetings
from sim_node.model.morphology import Morphology
from sim_node.model.sensors import center_of_mass
from sim_node.model.work import WorkMeter, make_work_meter, measure_work, nothing_measured
from sim_node.munk2d.engine import PymunkEngine, move_disturbed
from sim_node.numerics.jit import compiled
from sim_node.simulation import Diverged, Simulation
from snca_ros.controller import Controller, step_all, step_all_faulty
from snca_ros.evolution.tasks.task import RECORDS, TRANSIENT, Episode, mean_velocity

__all__ = [
    'EPISODE', 'EPISODE_RUNNERS', 'LONGEST', 'TRANSIENT', 'Episode', 'Records', 'mean_velocity',
    'record', 'run_compiled', 'run_episode', 'run_step_by_step',
]

EPISODE = 30.0
"""Length of an episode [s] (paper, section 4.1)."""

LONGEST = 3600.0
"""Longest episode that is accepted [s]."""


class Records(NamedTuple):
    """Arrays that compiled code records besides the centres of mass."""

    sources: tuple[np.ndarray, ...]  # (n_voxels,) or in lanes (n_voxels, W)
    rows: np.ndarray  # (n_sources, n_steps, *shape of a source), written
    meter: WorkMeter  # of the source `work`; without springs if it is not recorded
    masses: np.ndarray  # (n_masses, 3 or more, W) of the engine
    actuation: np.ndarray  # (n_voxels, W) of the engine

    @classmethod
    def of(
        cls, names: tuple[str, ...], world: Any, n_steps: int, morphology: Morphology,
        material: Material,
    ) -> 'Records | None':
        """Return the records of those names for `n_steps` control steps; None if there is no name.

        Args:
            names: of `tasks.task.RECORDS`.
            world: has the engine's arrays as attributes, as `RobotArrays`; in lanes they have a
                last axis of W. The robots are at their start.
            n_steps: number of control steps.
            morphology, material: of the robots.
        """
        if not names:
            return None
        n_masses, n_fields, *_ = world.masses.shape
        masses = world.masses.reshape(n_masses, n_fields, -1)
        actuation = world.actuation.reshape(morphology.n_voxels, -1)
        meter = make_work_meter(morphology, material, masses.shape[2])
        work = meter.work.reshape(world.actuation.shape)
        sources = tuple(work if name == 'work' else getattr(world, name) for name in names)
        if 'work' not in names:
            meter = nothing_measured(meter)
        measure_work(meter, masses, actuation)
        rows = np.empty((len(names), n_steps, *work.shape))
        return cls(sources, rows, meter, masses, actuation)


@compiled
def record(records, k):
    """Record the sources as they are after control step `k`."""
    measure_work(records.meter, records.masses, records.actuation)
    for i in range(len(records.sources)):
        records.rows[i, k] = records.sources[i]


@compiled
def _walk(
    world, robot, cells, neighbors, n_steps, disturbance, faults, centers, records, feet_of_walls,
    meetings,
):
    """Run an episode and return the number of steps before the physics diverged.

    If `faults` or `records` is None, their code is not compiled.

    Args:
        centers: (n_steps + 1, 2) centres of mass [m], written.
        feet_of_walls, meetings: see `note_meetings`.
        The other arguments are the parts of a simulation and a controller.
    """
    actuation = np.zeros(neighbors.shape[0])
    centers[0] = center_of_mass(world.masses)
    for k in range(n_steps):
        if faults is None:
            step_all(cells, neighbors, robot.readings, k, actuation)
        else:
            step_all_faulty(cells, neighbors, robot.readings, k, actuation, faults, k)
        if not move_disturbed(world, robot, actuation, k + 1, disturbance, k):
            return k
        centers[k + 1] = center_of_mass(world.masses)
        note_meetings(world.corners.reshape(-1, 2, 1), feet_of_walls, k + 1, meetings)
        if records is not None:
            record(records, k)
    return n_steps


def run_episode(
    simulation: Simulation,
    controller: Controller,
    duration: float = EPISODE,
    records: tuple[str, ...] = (),
) -> Episode:
    """Run an episode of a robot from its start and return it.

    Args:
        simulation: simulation of the robot; it is reset.
        controller: controller of the robot; it is reset.
        duration: duration of the episode [s].
        records: names of arrays to record besides the centres of mass, of `tasks.task.RECORDS`.

    Raises:
        InvalidInput: there is no such record.
    """
    for name in records:
        check_name('records', name, RECORDS)
    run = EPISODE_RUNNERS.get(type(simulation.backend), run_step_by_step)
    return run(simulation, controller, steps_in(duration), records)


class Cells(Protocol):
    """What actuates a robot: a `Controller`, or anything that steps like one."""

    def reset(self) -> None:
        """Go back to the start of an episode."""

    def step(self, readings: np.ndarray) -> np.ndarray:
        """Return the actuation, (n_voxels,), for readings, (n_voxels, n_sensors)."""


def run_step_by_step(
    simulation: Simulation, controller: Cells, n_steps: int, records: tuple[str, ...] = ()
) -> Episode:
    """Run an episode of `n_steps` control steps, in any engine."""
    readings = simulation.reset()
    controller.reset()
    centers = [simulation.center]
    rows = {name: np.empty((n_steps, simulation.morphology.n_voxels)) for name in records}
    meter = make_work_meter(simulation.morphology, simulation.material)
    _work(meter, simulation.world)
    diverged = False
    for k in range(n_steps):
        try:
            readings = simulation.step(controller.step(readings))
        except Diverged:
            diverged = True
            break
        centers.append(simulation.center)
        for name, array in rows.items():
            world = simulation.world
            array[k] = _work(meter, world) if name == 'work' else getattr(world, name)
    done = len(centers) - 1
    kept = {name: array[:done] for name, array in rows.items()}
    return Episode(np.array(centers), diverged, records=kept, walls=simulation.walls)


def _work(meter: WorkMeter, world: RobotArrays) -> np.ndarray:
    """Return the work of one robot in the last control step, (n_voxels,), see `measure_work`."""
    masses, actuation = map(np.ascontiguousarray, (world.masses, world.actuation))
    measure_work(meter, masses[:, :, np.newaxis], actuation[:, np.newaxis])
    return meter.work[:, 0]


def run_compiled(
    simulation: Simulation, controller: Controller, n_steps: int, records: tuple[str, ...] = ()
) -> Episode:
    """Run an episode of `n_steps` control steps in the pymunk engine, as one compiled loop."""
    simulation.reset()
    controller.reset()
    centers = np.empty((n_steps + 1, 2))
    recorded = Records.of(
        records, simulation.world, n_steps, simulation.morphology, simulation.material
    )
    done = _walk(
        simulation.world,
        simulation.sensing,
        controller.cells.state,
        controller.neighbors,
        n_steps,
        simulation.disturbance(n_steps),
        controller.fault_tables(n_steps),
        centers,
        recorded,
        simulation.feet_of_walls,
        simulation.meetings,
    )
    simulation.step_count = controller.step_count = done
    rows = recorded.rows[:, :done] if recorded else ()
    kept = dict(zip(records, rows, strict=True))
    return Episode(centers[: done + 1], done < n_steps, records=kept, walls=simulation.walls)


EPISODE_RUNNERS: dict[
    type[Engine], Callable[[Simulation, Controller, int, tuple[str, ...]], Episode]
] = {
    PymunkEngine: run_compiled,
}
"""Engines with a faster function than `run_step_by_step`, which must return the same bits.

It is not used for classes derived from such an engine, since they may step differently.
"""
