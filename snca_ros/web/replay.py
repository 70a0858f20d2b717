"""Builds pages that play the walk of a controller, of a run's best controller, or of a bag."""

import math
from pathlib import Path

from snca_ros.bundled import find_controller
from snca_ros.controller_file import load_controller
from snca_ros.evolution.checkpoint_arrays import HISTORY
from snca_ros.evolution.history import History, read_history
from snca_ros.faults import parse_faults
from snca_ros.recording.bag import Recording
from snca_ros.recording.body import in_body_of
from snca_ros.recording.offline import record_offline, replayed_thresholds
from snca_ros.trained_controller import TrainedController
from snca_ros.web.page import walk_page


def controller_page(
    file: Path, duration: float, terrain: str = '', faults: str = '', run: Path | None = None,
    shape: str = '', without: str = '',
) -> str:
    """Return the page of an offline walk of a controller.

    Args:
        file: of the controller.
        duration: of the walk [s].
        terrain: name of the terrain; '' for the one that the controller was evolved on.
        faults: text that `parse_faults` reads; '' for none.
        run: folder of the run whose best controller it is; its name becomes the title, and the
            page shows its history.
        shape: body for the controller, see `TrainedController.in_body`; '' for its own.
        without: names of voxels to leave out, with commas between them.

    Raises:
        InvalidInput: the controller cannot be read, it does not fit the body, the terrain or a
            fault is unknown, or the physics diverges.
    """
    trained = load_controller(file).in_body(shape).without(without)
    recording, thresholds = record_offline(
        trained, file, duration, terrain, parse_faults(faults)
    )
    name = run.resolve().name if run else file.stem
    if trained.home:
        name = f'{name} as {trained.morphology.label}'
    history = read_history(run) if run else None
    with_faults = f' with {faults}' if faults else ''
    return walk_page(
        recording, f'{name} on {terrain or trained.terrain}{with_faults}',
        facts=[_describe(trained)], thresholds=thresholds,
        directional=trained.architecture.directional,
        history=_columns(history) if history else None,
        history_label=history.label if history else '',
    )


def bag_page(recording: Recording, controller: str | None = None) -> tuple[str, str]:
    """Return the page of a recorded walk, and a warning if its physics is not the controller's.

    Args:
        recording: of a bag with markers.
        controller: file or name of the controller that walked; with it the page shows thresholds.

    Returns:
        HTML, and a sentence if the controller was evolved in another physics, else ''.

    Raises:
        InvalidInput: the bag has no markers, or the controller does not fit the body of the walk.
    """
    facts = [
        f'Bag {recording.path}, {len(recording.voxel_names)} voxels'
        f'{f" ({recording.body.label})" if recording.body else ""}, physics {recording.physics}'
    ]
    thresholds, directional, warning = None, None, ''
    if controller:
        trained = in_body_of(recording, load_controller(find_controller(controller)))
        thresholds = replayed_thresholds(recording, trained)
        directional = trained.architecture.directional
        facts.append(_describe(trained))
        if trained.solver.physics != recording.physics:
            warning = (
                f'The controller was evolved in the physics {trained.solver.physics}, the bag was '
                f'recorded in {recording.physics}: this is not the walk that evolution scored.'
            )
            facts.append(warning)
    page = walk_page(
        recording, recording.robot, facts=facts, thresholds=thresholds, directional=directional
    )
    return page, warning


def _describe(trained: TrainedController) -> str:
    """Return one sentence about a controller: shape, architecture, and its v_x in evolution."""
    cells = trained.architecture
    return (
        f'{trained.morphology.label}, {trained.morphology.n_voxels} voxels, {cells.name} '
        f'{cells.neuron_model}, {trained.evolved} in the physics '
        f'{trained.solver.physics} for {trained.evaluations} episodes to '
        f'{trained.achieved}'
    )


def _columns(history: History) -> dict[str, list[float | None]]:
    """Return the columns of a run's history by name; a score that is not finite is None."""
    return {
        name: [value if math.isfinite(value) else None for value in column]
        for name, column in zip(HISTORY, history.rows.T.tolist(), strict=True)
    }
