"""What kills of voxels did to their messages: lost ones, and ones that were published twice.

A voxel sends a message to one reader after the other. A kill in between loses it for the others,
and nobody can send it again. If the voxel had not yet answered, its next process publishes the
message of that step again, with another content, since its cell was reset.
"""

import numpy as np

from snca_ros.recording.outcomes import Outcome
from snca_ros.recording.streams import Stream


def lost_by_kills(missing: np.ndarray, outcomes: np.ndarray, n_kills: int) -> np.ndarray:
    """Return the control steps whose answer is missing because the voxel was killed.

    The simulation had the answer in time and the recorder did not. Each kill explains one step;
    further steps remain unexplained, the first ones count as explained.

    Args:
        missing: control steps whose answer is not in the bag.
        outcomes: (n_steps,) `Outcome` of each answer of the voxel.
        n_kills: how often the voxel was killed.
    """
    return missing[outcomes[missing] == Outcome.IN_TIME][:n_kills]


def published_twice(stream: Stream, mine: np.ndarray) -> np.ndarray:
    """Return the control steps of which a topic has several messages with different content.

    Args:
        stream: all messages of the topic.
        mine: (n,) bool, which of them are of the episode.
    """
    kept = stream.select(np.flatnonzero(mine))
    by_step = np.argsort(kept.steps, kind='stable')
    steps, numbers = kept.steps[by_step], kept.numbers[by_step]
    changed = (numbers[1:] != numbers[:-1]).any(axis=tuple(range(1, numbers.ndim)))
    differ = (np.diff(steps) == 0) & changed
    return np.unique(steps[1:][differ])


def count_kills(n_processes: int, sent: np.ndarray) -> int:
    """Return how often a voxel was killed at most.

    Args:
        n_processes: number of processes that ran its node.
        sent: (n_steps,) whether a message of it is in the bag. If the last ones are missing, it was
            killed once more and not restarted.
    """
    return n_processes - 1 + (not sent[-3:].any())
