"""The task: walk to the right. One episode gives v_x, the fitness."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.engine import Engine
from sim_node.model.sensors import center_of_mass
from sim_node.munk2d.engine import PymunkEngine, move_disturbed
from sim_node.numerics.jit import compiled
from sim_node.simulation import Diverged, Simulation
from snca_ros.controller import Controller, step_all, step_all_faulty

EPISODE, TRANSIENT = 30.0, 5.0
"""Length of an episode [s], and what is discarded at its start [s] (paper, section 4.1)."""

LONGEST = 3600.0
"""Longest episode that is accepted [s]."""


@compiled
def _walk(world, robot, cells, neighbors, n_steps, disturbance, faults, centers):
    """Run a whole episode; write `centers` (n_steps + 1, 2); return the steps that were sane.

    Without `faults`, None, what they cost is not even compiled.
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
    return n_steps


@dataclass(frozen=True)
class Episode:
    """What an episode left behind.

    Attributes:
        centers: (n + 1, 2) centre of mass [m] at each control step.
        diverged: the physics left the finite numbers before the end.
    """

    centers: np.ndarray
    diverged: bool

    def velocity(self, transient: float = TRANSIENT) -> float:
        """Return v_x [m/s] after `transient` seconds, or -inf if the episode diverged."""
        return -np.inf if self.diverged else mean_velocity(self.centers[:, 0], transient)


def mean_velocity(x: np.ndarray, transient: float = TRANSIENT) -> float:
    """Return the mean velocity [m/s] of positions `x` [m], one per control step from step 0."""
    first = round(transient * CONTROL_RATE)
    if len(x) <= first + 1:
        first = 0
    if len(x) < 2:
        return 0.0
    return float((x[-1] - x[first]) / ((len(x) - 1 - first) / CONTROL_RATE))


def run_episode(
    simulation: Simulation, controller: Controller, duration: float = EPISODE
) -> Episode:
    """Let `controller` walk `simulation`'s robot from its start for `duration` seconds."""
    run = EPISODE_RUNNERS.get(type(simulation.backend), run_step_by_step)
    return run(simulation, controller, round(duration * CONTROL_RATE))


def run_step_by_step(simulation: Simulation, controller: Controller, n_steps: int) -> Episode:
    """Run an episode of `n_steps` control steps, in any engine."""
    readings = simulation.reset()
    controller.reset()
    centers = [simulation.center]
    try:
        for _ in range(n_steps):
            readings = simulation.step(controller.step(readings))
            centers.append(simulation.center)
    except Diverged:
        return Episode(np.array(centers), diverged=True)
    return Episode(np.array(centers), diverged=False)


def run_compiled(simulation: Simulation, controller: Controller, n_steps: int) -> Episode:
    """Run the same in pymunk as one compiled loop."""
    simulation.reset()
    controller.reset()
    centers = np.empty((n_steps + 1, 2))
    done = _walk(
        simulation.world,
        simulation.sensing,
        controller.cells.state,
        controller.neighbors,
        n_steps,
        simulation.disturbance(n_steps),
        controller.fault_tables(n_steps),
        centers,
    )
    simulation.step_count = controller.step_count = done
    return Episode(centers[: done + 1], diverged=done < n_steps)


EPISODE_RUNNERS: dict[type[Engine], Callable[[Simulation, Controller, int], Episode]] = {
    PymunkEngine: run_compiled,
}
"""Engines whose episodes have a faster way than `run_step_by_step`, which must give the same bits.

A class that derives from one of them does not inherit it, since it may step in another way.
"""
