"""A walk without ROS, recorded as a bag would hold it; the thresholds of a walk's neurons."""

import math
from pathlib import Path

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.errors import InvalidInput
from sim_node.model.sensors import N_SENSORS
from sim_node.simulation import Diverged
from snca_ros.cell.snn import THETA_0
from snca_ros.controller import Controller
from snca_ros.controller_file import TrainedController
from snca_ros.faults import NO_FAULTS, Faults
from snca_ros.recording.bag import Recording
from snca_ros.recording.poses import Poses


def record_offline(
    trained: TrainedController,
    path: Path,
    duration: float,
    terrain: str = '',
    faults: Faults | None = None,
) -> tuple[Recording, np.ndarray | None]:
    """Let a robot walk; return what a bag of it would hold, and its thresholds.

    Args:
        trained: the controller.
        path: its file.
        duration: of the walk [s].
        terrain: '' for the one that the controller was evolved on.
        faults: what goes wrong.

    Returns:
        The recording, and (n_steps, n_voxels) mean thresholds as of `mean_thresholds`; None if
        the cells have none.

    Raises:
        InvalidInput: the terrain is unknown, or the physics diverges with this controller.
    """
    simulation = trained.simulation(terrain, faults=faults or NO_FAULTS)
    controller = trained.controller(faults)
    n_steps, n_voxels = round(duration * CONTROL_RATE), trained.morphology.n_voxels
    architecture = trained.architecture
    messages = np.zeros((
        n_steps + 1, n_voxels, architecture.n_destinations * architecture.n_c,
        architecture.message_width,
    ))
    centers, corners = np.empty((n_steps + 1, 2)), np.empty((n_steps + 1, n_voxels, 4, 2))
    readings = np.full((n_steps + 1, n_voxels, N_SENSORS), np.nan)
    actuation, thresholds = np.full((2, n_steps + 1, n_voxels), np.nan)
    now = simulation.reset()
    centers[0], corners[0] = simulation.center, simulation.world.corners
    for k in range(n_steps):
        readings[k], actuation[k] = now, controller.step(now)
        messages[k] = controller.cells.outbox.reshape(messages.shape[1:])
        thresholds[k] = mean_thresholds(controller)
        try:
            now = simulation.step(actuation[k])
        except Diverged as error:
            raise InvalidInput('controller', str(error), 'a walk that stays finite') from None
        centers[k + 1], corners[k + 1] = simulation.center, simulation.world.corners
    ground = np.column_stack([simulation.terrain.x, simulation.terrain.y])
    spiking = architecture.spiking
    recording = Recording(
        path=path, closed=True, robot=trained.morphology.name, episode=0, n_episodes=1,
        voxel_names=trained.morphology.voxel_names, centers=centers, readings=readings,
        actuation=actuation,
        spikes=messages.astype(np.uint8) if spiking else None,
        values=None if spiking else messages[..., 0],
        heard=np.broadcast_to(np.arange(n_steps + 1)[:, None] < n_steps, actuation.shape),
        rate=math.nan, counts=(), health={},
        poses=Poses(np.arange(n_steps + 1), corners, ground), physics=trained.solver.physics,
    )
    return recording, thresholds if spiking else None


def mean_thresholds(controller: Controller) -> np.ndarray:
    """Return the mean threshold [mV] of each voxel's neurons but its inputs, (n_voxels,).

    Cells of perceptrons have none: NaN.
    """
    cells = controller.cells.state
    if not cells.spiking:
        return np.full(len(cells.rows), np.nan)
    if cells.lif.as_printed:
        thresholds = cells.theta
    else:
        thresholds = np.minimum(THETA_0, cells.ceilings[cells.rows]) + cells.psi
    layers = [thresholds[:, i, :n] for i, n in enumerate(cells.sizes) if i > 0]
    return np.concatenate(layers, axis=1).mean(axis=1)


def replayed_thresholds(recording: Recording, trained: TrainedController) -> np.ndarray | None:
    """Return the thresholds of the cells of a recorded walk, which bags do not hold.

    The recorded readings are given to the controller; as long as it answers as the walk's voxels
    did, its neurons are theirs. From where it does not (messages were lost or late, voxels were
    dead, or it is another controller) or a reading is missing, thresholds are NaN.

    Returns:
        (n_steps, n_voxels) as of `mean_thresholds`; None if the cells have no thresholds.

    Raises:
        InvalidInput: the controller is of another shape.
    """
    names = trained.morphology.voxel_names
    if names != recording.voxel_names:
        shown, expected = f'{len(names)} voxels', f'the {len(recording.voxel_names)} of the bag'
        raise InvalidInput('controller', f'{trained.morphology.grid_string}, {shown}', expected)
    controller = trained.controller()
    thresholds = np.full(recording.actuation.shape, np.nan)
    for k, readings in enumerate(recording.readings):
        if not np.isfinite(readings).all():
            break
        if not np.array_equal(controller.step(readings), recording.actuation[k]):
            break
        thresholds[k] = mean_thresholds(controller)
    return thresholds if trained.architecture.spiking else None
