"""The body of a recorded walk, and controllers in that body."""

import contextlib
from itertools import islice

from sim_node.errors import InvalidInput
from sim_node.model.morphology import Morphology, parse_morphology
from snca_ros.recording.recording import Recording
from snca_ros.recording.storage import Topic
from snca_ros.recording.streams import types
from snca_ros.trained_controller import TrainedController

_TRIED = 10  # messages whose child_frame_id is examined


def read_body(odometry: Topic, voxels: tuple[str, ...]) -> Morphology | None:
    """Return the body that the odometry of a bag names in its child_frame_id.

    Args:
        odometry: the topic.
        voxels: names of the voxels in the bag.

    Returns:
        The body, with missing voxels; None if no message names one with these voxels.
    """
    for data in islice(odometry.messages, _TRIED):
        # rosbags raises various exceptions for bytes of another layout.
        with contextlib.suppress(Exception):
            message = types().deserialize_cdr(data, odometry.type)
            body = parse_morphology(message.child_frame_id)
            if body.voxel_names == voxels:
                return body
    return None


def in_body_of(recording: Recording, trained: TrainedController) -> TrainedController:
    """Return a controller in the body of a recording, see `TrainedController.in_body`.

    Raises:
        InvalidInput: it does not fit that body, or the bag does not say which body that is.
    """
    names = trained.morphology.voxel_names
    if names == recording.voxel_names:
        return trained
    try:
        if recording.body:
            return trained.in_body(recording.body)
    except InvalidInput:
        pass
    shown, expected = f'{len(names)} voxels', f'the {len(recording.voxel_names)} of the bag'
    raise InvalidInput('controller', f'{trained.morphology.grid_string}, {shown}', expected)
