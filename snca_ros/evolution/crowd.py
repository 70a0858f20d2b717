"""Episodes of many controllers at once: one robot each, side by side in the batched engine."""

import numpy as np

from sim_node.batched.robots import Robots, advance_group
from sim_node.batched.sensing import write_centers
from sim_node.compiled import compiled
from sim_node.lanes import load, store
from sim_node.morphology import Morphology
from sim_node.sensors import N_SENSORS
from sim_node.stamps import CONTROL_RATE
from snca_ros.cell.group import CellGroup, step_group
from snca_ros.cell.nca import Architecture
from snca_ros.evolution.locomotion import EPISODE, Episode


@compiled
def _walk(group, cells, noise, centers, done):
    """Run whole episodes; write `centers` (n_steps + 1, 2, W) and the steps `done` (W,)."""
    write_centers(group.mass_lanes, centers[0])
    for k in range(centers.shape[0] - 1):
        _add_noise(group.readings, noise[k])
        step_group(cells, group.readings, k, group.actuation)
        advance_group(group, k + 1)
        write_centers(group.mass_lanes, centers[k + 1])
        for lane in range(done.shape[0]):
            if done[lane] == k and group.sane_lanes[0, 0, lane] > 0.0:
                done[lane] = k + 1


@compiled
def _add_noise(readings, noise):
    """Do for all robots what `sim_node.sensors.add_noise` does for one; all get the same noise."""
    for i in range(noise.shape[0]):
        for sensor in range(noise.shape[1]):
            noisy = load(readings, i, sensor) + noise[i, sensor]
            store(readings, i, sensor, min(max(noisy, 0.0), 1.0))


def run_episodes(
    robots: Robots,
    architecture: Architecture,
    morphology: Morphology,
    thetas: np.ndarray,
    duration: float = EPISODE,
    noise: np.ndarray | None = None,
) -> list[Episode]:
    """Let each of up to W controllers walk a robot of its own from the start.

    Args:
        robots: W robots of that morphology, put down anew.
        architecture: of the controllers.
        morphology: of the robots.
        thetas: (n, n_parameters), a controller per row, n <= W. Other lanes' weights are 0.
        duration: of the episodes [s].
        noise: (n_steps + 1, n_voxels, 4) added to the readings of step 0, 1, ... of every robot.

    Returns:
        An episode per controller; each is the same, to the bit, whatever the others are.
    """
    width = robots.group.reading_lanes.shape[2]
    n_steps = round(duration * CONTROL_RATE)
    cells = CellGroup(architecture, morphology, thetas, width)
    if noise is None:
        noise = np.empty((n_steps + 1, 0, N_SENSORS))
    centers = np.empty((n_steps + 1, 2, width))
    done = np.zeros(width, dtype=np.int64)
    robots.reset()
    _walk(robots.group, cells.state, noise, centers, done)
    robots.step_count = n_steps
    return [
        Episode(centers[: done[lane] + 1, :, lane], diverged=bool(done[lane] < n_steps))
        for lane in range(len(thetas))
    ]
