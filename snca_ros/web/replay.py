"""Pages that play the walk of a controller, a run's best, or a bag."""

import math
import sys
from pathlib import Path

from sim_node.errors import InvalidInput
from snca_ros.bundled import find_controller
from snca_ros.controller_file import TrainedController, load_controller
from snca_ros.evolution.checkpoint import HISTORY
from snca_ros.evolution.history import read_history
from snca_ros.files import write_text
from snca_ros.recording.bag import Recording
from snca_ros.recording.offline import replayed_thresholds
from snca_ros.web.page import walk_page


def write_bag_page(recording: Recording, path: Path, controller: str | None) -> None:
    """Write the page of a recorded walk; its `controller`, a file or a name, adds thresholds.

    Raises:
        InvalidInput: the bag has no markers, the controller is of another robot, or `path` cannot
            be written.
    """
    facts = [
        f'Bag {recording.path}, {len(recording.voxel_names)} voxels, physics {recording.physics}'
    ]
    thresholds, directional, differs = None, None, ''
    if controller:
        trained = load_controller(find_controller(controller))
        thresholds = replayed_thresholds(recording, trained)
        directional = trained.architecture.directional
        facts.append(described(trained))
        if trained.solver.physics != recording.physics:
            differs = (
                f'The controller was evolved in the physics {trained.solver.physics}, the bag was '
                f'recorded in {recording.physics}: this is not the walk that evolution scored.'
            )
            facts.append(differs)
    write_page(path, walk_page(
        recording, recording.robot, facts=facts, thresholds=thresholds, directional=directional
    ))
    if differs:
        print(differs, file=sys.stderr)


def write_page(path: Path, page: str) -> None:
    """Write a page, atomically, and say so; InvalidInput if it cannot be written."""
    try:
        write_text(path, page)
    except OSError as error:
        raise InvalidInput('html', f'{path}: {error.strerror}', 'a file that can be written') \
            from None
    print(f'page: {path}, {len(page) / 1e6:.1f} MB')


def described(trained: TrainedController) -> str:
    """Return what a controller is and how well it did in evolution, as a sentence."""
    cells = trained.architecture
    return (
        f'{trained.morphology.name}, {trained.morphology.n_voxels} voxels, {cells.name} '
        f'{cells.neuron_model}, evolved on {trained.terrain} in the physics '
        f'{trained.solver.physics} for {trained.evaluations} evaluations to v_x '
        f'{trained.fitness:.3f} m/s'
    )


def history_columns(run: Path) -> dict[str, list[float | None]]:
    """Return the columns of a run's history by name; v_x that is not finite is None."""
    return {
        name: [value if math.isfinite(value) else None for value in column]
        for name, column in zip(HISTORY, read_history(run).rows.T.tolist(), strict=True)
    }
