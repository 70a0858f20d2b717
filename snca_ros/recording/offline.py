"""Records walks without ROS, compares them with walks of a graph, computes thresholds."""

import math
from pathlib import Path

import numpy as np

from sim_node.control_time import steps_in
from sim_node.errors import InvalidInput
from sim_node.simulation import Diverged, Simulation
from snca_ros.controller import Controller
from snca_ros.evolution.episode import run_episode
from snca_ros.faults import NO_FAULTS, Faults
from snca_ros.recording.body import in_body_of
from snca_ros.recording.episode import RECORDABLE, RecordedEpisode
from snca_ros.recording.outcomes import Outcome
from snca_ros.recording.poses import Poses
from snca_ros.recording.recording import Recording
from snca_ros.trained_controller import TrainedController


def record_offline(
    trained: TrainedController,
    path: Path,
    duration: float,
    terrain: str = '',
    faults: Faults | None = None,
) -> tuple[Recording, np.ndarray | None]:
    """Simulate a walk without ROS; return the recording that a bag would give, and thresholds.

    Args:
        trained: the controller.
        path: its file.
        duration: of the walk [s].
        terrain: name of the terrain; '' for the one that the controller was evolved on.
        faults: of body and cells; None for none.

    Returns:
        The recording, and (n_steps, n_voxels) thresholds as `mean_thresholds` returns them; None
        if the cells have no thresholds.

    Raises:
        InvalidInput: the terrain is unknown, or the physics diverges with this controller.
    """
    simulation = trained.simulation(terrain, faults=faults or NO_FAULTS)
    episode = record_episode(simulation, trained.controller(faults), duration)
    if episode.diverged:
        shown = f'{trained.morphology.name}: not finite at step {len(episode.centers)}'
        raise InvalidInput('controller', shown, 'a walk that stays finite')
    actuation, readings = _with_last_row(episode.actuation, np.nan), episode.readings.copy()
    readings[-1] = np.nan  # no cell reads them
    steps = np.arange(len(episode.centers))
    ground = np.column_stack([simulation.terrain.x, simulation.terrain.y])
    spikes, values, thresholds = episode.spikes, episode.values, episode.thresholds
    recording = Recording(
        path=path, closed=True, robot=trained.morphology.name, episode=0, n_episodes=1,
        voxel_names=episode.voxel_names, centers=episode.centers, readings=readings,
        actuation=actuation, applied=_with_last_row(episode.applied, np.nan),
        outcomes=_with_last_row(np.full(episode.heard.shape, Outcome.IN_TIME, np.uint8),
                                Outcome.UNKNOWN),
        spikes=None if spikes is None else _with_last_row(spikes, 0),
        values=None if values is None else _with_last_row(values, 0.0),
        heard=_with_last_row(episode.heard, False), late=np.zeros(actuation.shape, bool),
        rate=math.nan, counts=(), health={},
        poses=Poses(steps, episode.corners, ground), physics=trained.solver.physics,
        sensors=simulation.sensors, body=trained.morphology,
    )
    return recording, None if thresholds is None else _with_last_row(thresholds, np.nan)


def _with_last_row(array: np.ndarray, value: float) -> np.ndarray:
    """Return an array with a row appended for the last control step, at which no cell steps."""
    return np.concatenate([array, np.full_like(array[:1], value)])


def record_episode(
    simulation: Simulation,
    controller: Controller,
    duration: float,
    record: tuple[str, ...] = RECORDABLE,
    name: str = '',
) -> RecordedEpisode:
    """Run and record one episode of a robot, bit for bit as `run_episode` does.

    Args:
        simulation: of the robot; it is reset.
        controller: all cells of the robot; they are reset.
        duration: of the episode [s].
        record: names of `RECORDABLE`; an empty tuple takes less time.
        name: of the robot; '' for the name of its shape.
    """
    if record:
        centers, arrays, diverged = _recorded(
            simulation, controller, steps_in(duration), record
        )
    else:
        episode = run_episode(simulation, controller, duration)
        centers, arrays, diverged = episode.centers, {}, episode.diverged
    names = simulation.morphology.voxel_names
    return RecordedEpisode(
        centers, diverged, name or simulation.morphology.name, names,
        {**{key: arrays.get(key) for key in record}, **arrays}, simulation.sensors,
        walls=simulation.walls,
    )


def _recorded(
    simulation: Simulation, controller: Controller, n_steps: int, record: tuple[str, ...]
) -> tuple[np.ndarray, dict[str, np.ndarray], bool]:
    """Return the centres, the requested arrays that exist, and whether the episode diverged."""
    cell, n_voxels = controller.architecture, simulation.morphology.n_voxels
    channels = cell.n_destinations * cell.n_c
    shapes: dict[str, tuple] = {  # of a row, and its type
        'readings': (simulation.readings.shape, np.float64),
        'corners': ((n_voxels, 4, 2), np.float64),
        'actuation': ((n_voxels,), np.float64),
        'applied': ((n_voxels,), np.float64),
    }
    if cell.spiking:
        shapes['spikes'] = (n_voxels, channels, cell.message_width), np.uint8
    else:
        shapes['values'] = (n_voxels, channels), np.float64
    if hasattr(cell.model, 'thresholds'):
        shapes['thresholds'] = (n_voxels,), np.float64
    n_rows = {'readings': n_steps + 1, 'corners': n_steps + 1}
    arrays = {
        name: np.empty((n_rows.get(name, n_steps), *shape), kind)
        for name, (shape, kind) in shapes.items()
        if name in record or (name == 'applied' and 'actuation' in record)
    }
    centers, done = np.empty((n_steps + 1, 2)), n_steps

    def keep(name: str, k: int, row: np.ndarray) -> None:
        if name in arrays:
            arrays[name][k] = row.reshape(arrays[name].shape[1:])

    now = simulation.reset()
    controller.reset()
    for k in range(n_steps + 1):
        centers[k] = simulation.center
        keep('readings', k, now)
        keep('corners', k, simulation.world.corners)
        if k == n_steps:
            break
        actuation = controller.step(now)
        keep('actuation', k, actuation)
        keep('spikes' if cell.spiking else 'values', k, controller.cells.outbox)
        if 'thresholds' in arrays:
            keep('thresholds', k, mean_thresholds(controller))
        try:
            now = simulation.step(actuation)
        except Diverged:
            done = k
            break
        keep('applied', k, simulation.world.actuation)
    ends = {name: done + 1 if name in n_rows else done for name in arrays}
    arrays = {name: array[: ends[name]] for name, array in arrays.items()}
    return centers[: done + 1], arrays, done < n_steps


def compare_with_twin(
    centers: np.ndarray, twin: np.ndarray, may_differ: bool
) -> tuple[str, bool]:
    """Compare a walk with the offline walk of the same controller, its twin.

    Args:
        centers: (n_steps, 2) recorded positions of the robot's centre [m].
        twin: (n_steps, 2) positions in the offline walk [m].
        may_differ: whether they may differ, because messages can be late or voxels can die.

    Returns:
        A line of text with the result, and whether the walk passes: it is bit for bit the same, or
        may differ.
    """
    alike = centers.shape == twin.shape
    same = alike and np.array_equal(centers, twin)
    verdict = 'bit for bit the same' if same else 'NOT THE SAME'
    if may_differ and alike and not same:
        parted = np.flatnonzero((centers != twin).any(axis=1))[0]
        verdict = f'the same until step {parted}, then changed by late, lost or dead voxels'
    return f'offline twin: {len(twin)} positions of the centre, {verdict}', same or may_differ


def mean_thresholds(controller: Controller) -> np.ndarray:
    """Return the mean threshold [mV] of each voxel's neurons except its inputs, (n_voxels,).

    It is NaN for MLP cells, which have no thresholds.
    """
    thresholds = controller.cells.thresholds()
    if thresholds is None:
        return np.full(controller.morphology.n_voxels, np.nan)
    return thresholds.mean(axis=1)


def replayed_thresholds(recording: Recording, trained: TrainedController) -> np.ndarray | None:
    """Return the thresholds of the cells of a recorded walk, by stepping its controller again.

    Bags hold no thresholds. The controller gets the recorded readings; as long as it computes the
    recorded actuation, its neurons have the state that the walk's had. From the first step at which
    it does not (messages were lost or late, voxels were dead, or it is another controller) or a
    reading is missing, thresholds are NaN.

    Returns:
        (n_steps, n_voxels) as `mean_thresholds`; None if the cells have no thresholds.

    Raises:
        InvalidInput: the controller does not fit the body of the walk.
    """
    controller = in_body_of(recording, trained).controller()
    thresholds = np.full(recording.actuation.shape, np.nan)
    for k, readings in enumerate(recording.readings):
        if not np.isfinite(readings).all():
            break
        if not np.array_equal(controller.step(readings), recording.actuation[k]):
            break
        thresholds[k] = mean_thresholds(controller)
    return thresholds if hasattr(trained.architecture.model, 'thresholds') else None
