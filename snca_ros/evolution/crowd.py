"""Episodes of many controllers at once: one robot each, side by side in the batched engine."""

import numpy as np

from sim_node.batched.robots import Robots, advance_group
from sim_node.batched.sensing import is_sane, write_centers
from sim_node.compiled import compiled
from sim_node.morphology import Morphology
from sim_node.sensors import N_SENSORS, add_noise
from sim_node.stamps import CONTROL_RATE
from snca_ros.cell.cells import Cells
from snca_ros.cell.nca import Architecture
from snca_ros.controller import step_all
from snca_ros.evolution.locomotion import EPISODE, Episode


@compiled
def _walk(group, cells, neighbors, noise, centers, done):
    """Run whole episodes; write `centers` (n_steps + 1, 2, W) and the steps `done` (W,).

    The cells of all robots are one crowd, robot by robot; `neighbors` joins those of one robot.
    """
    n, _, width = group.reading_lanes.shape
    readings, actuation = np.empty((width * n, N_SENSORS)), np.empty(width * n)
    write_centers(group, centers[0])
    for k in range(centers.shape[0] - 1):
        for lane in range(width):
            own = readings[lane * n : (lane + 1) * n]
            for i in range(n):
                for sensor in range(N_SENSORS):
                    own[i, sensor] = group.reading_lanes[i, sensor, lane]
            add_noise(own, noise[k])
        step_all(cells, neighbors, readings, k, actuation)
        for lane in range(width):
            for i in range(n):
                group.actuation_lanes[i, 0, lane] = actuation[lane * n + i]
        advance_group(group, k + 1)
        write_centers(group, centers[k + 1])
        for lane in range(width):
            if done[lane] == k and is_sane(group, lane):
                done[lane] = k + 1


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
        thetas: (n, n_parameters), a controller per row, n <= W. Empty lanes repeat the last.
        duration: of the episodes [s].
        noise: (n_steps + 1, n_voxels, 4) added to the readings of step 0, 1, ... of every robot.

    Returns:
        An episode per controller; each is the same, to the bit, whatever the others are.
    """
    width = robots.group.reading_lanes.shape[2]
    n_steps = round(duration * CONTROL_RATE)
    lanes = np.minimum(np.arange(width), len(thetas) - 1)
    cells, neighbors = _crowd(architecture, morphology, np.asarray(thetas)[lanes])
    if noise is None:
        noise = np.empty((n_steps + 1, 0, N_SENSORS))
    centers = np.empty((n_steps + 1, 2, width))
    done = np.zeros(width, dtype=np.int64)
    robots.reset()
    _walk(robots.group, cells.state, neighbors, noise, centers, done)
    robots.step_count = n_steps
    return [
        Episode(centers[: done[lane] + 1, :, lane], diverged=bool(done[lane] < n_steps))
        for lane in range(len(thetas))
    ]


def _crowd(
    architecture: Architecture, morphology: Morphology, thetas: np.ndarray
) -> tuple[Cells, np.ndarray]:
    """Return the cells of all robots, robot by robot, and who neighbours whom among them."""
    n, width = morphology.n_voxels, len(thetas)
    weights = thetas.reshape(-1, architecture.weights_per_cell)
    rows = np.repeat(np.arange(width), n) if architecture.uniform else np.arange(width * n)
    first = n * np.arange(width)[:, None, None]
    neighbors = np.where(morphology.neighbors < 0, -1, morphology.neighbors + first)
    return Cells(architecture, weights, rows), neighbors.reshape(width * n, -1)
