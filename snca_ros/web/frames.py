"""Converts a recording into the arrays that a page draws, in compact integers."""

import base64
import zlib
from dataclasses import dataclass

import numpy as np

from sim_node.control_time import CONTROL_RATE, MARKER_PERIOD
from sim_node.errors import InvalidInput
from snca_ros.cell.coding import pack_trains
from snca_ros.recording.bag import Recording
from snca_ros.recording.gait import area_ratios, bridge_gaps, readings_of
from snca_ros.recording.outcomes import Outcome
from snca_ros.recording.poses import Poses

MAX_FRAMES = 18_001
"""Frames of ten minutes; in longer walks there are more control steps between frames."""

LATE, SILENT = 4, 8

_WINDOW = CONTROL_RATE  # control steps over which plots are averaged


@dataclass(frozen=True, eq=False)
class Packed:
    """An array of numbers stored as integers: number = low + step * raw.

    Attributes:
        raw: of any shape: uint8 or uint16, whose highest value means NaN, or float32, which holds
            the numbers themselves.
        low: number that raw value 0 stands for.
        step: difference between the numbers of neighbouring raw values.
    """

    raw: np.ndarray
    low: float = 0.0
    step: float = 1.0

    @classmethod
    def between(
        cls, numbers: np.ndarray, low: float, high: float, dtype: type = np.uint8
    ) -> 'Packed':
        """Return `numbers` packed, clipped to [low, high]; NaN stays NaN."""
        top = np.iinfo(dtype).max
        step = (high - low) / (top - 1)
        known = np.isfinite(numbers)
        scaled = np.clip(np.round((np.where(known, numbers, low) - low) / step), 0, top - 1)
        return cls(np.where(known, scaled, top).astype(dtype), low, step)

    @classmethod
    def fitting(cls, numbers: np.ndarray) -> 'Packed':
        """Return `numbers` packed as uint16 between their own minimum and maximum."""
        known = numbers[np.isfinite(numbers)]
        low, high = (float(known.min()), float(known.max())) if known.size else (0.0, 0.0)
        return cls.between(numbers, low, max(high, low + 1e-9), np.uint16)


@dataclass(frozen=True, eq=False)
class Frames:
    """The data of a walk that the page shows.

    Attributes:
        stride: control steps from frame to frame.
        arrays: by name: `x`, `y` centre [m], `corners` [m] relative to it, `area` ratio, `touch`,
            `actuation`, and means over a second: `v_x` [m/s], `rate` [Hz] and `threshold` [mV] of
            each voxel, one row per frame; `messages`, spike trains as integers or values, and
            `state` of each voxel, see `voxel_states`, one row per control step. Arrays of larger
            items come first, so that all are aligned.
        ground: (n_points, 2) profile x, y [m] of the terrain.
    """

    stride: int
    arrays: dict[str, Packed]
    ground: np.ndarray

    def describe(self) -> list[dict[str, object]]:
        """Return name, type, shape and scale of each array, for JSON, in the order of the bytes."""
        return [
            {
                'name': name, 'type': str(packed.raw.dtype), 'shape': packed.raw.shape,
                'low': packed.low, 'step': packed.step,
            }
            for name, packed in self.arrays.items()
        ]

    def encode(self) -> str:
        """Return all arrays, concatenated in little-endian order, compressed by zlib, as base64."""
        little = (p.raw.astype(p.raw.dtype.newbyteorder('<')) for p in self.arrays.values())
        return base64.b64encode(zlib.compress(b''.join(a.tobytes() for a in little))).decode()


def make_frames(recording: Recording, thresholds: np.ndarray | None = None) -> Frames:
    """Return the frames of a walk.

    Args:
        recording: of a bag or of `record_offline`.
        thresholds: (n_steps, n_voxels) [mV]; None if they are unknown.

    Raises:
        InvalidInput: the recording has no poses.
    """
    if recording.poses is None:
        expected = f'a bag with /{recording.robot}/markers'
        raise InvalidInput('markers', None, expected, str(recording.path))
    stride = MARKER_PERIOD * -(-recording.n_steps // (MARKER_PERIOD * MAX_FRAMES))
    at = np.arange(0, recording.n_steps, stride)
    centers, readings = bridge_gaps(recording.centers), recording.readings[at]
    arrays = {
        'x': Packed(centers[at, 0].astype(np.float32)),
        'y': Packed(centers[at, 1].astype(np.float32)),
        'corners': Packed.fitting(_shapes(recording.poses, centers, at)),
        'v_x': Packed.fitting(_velocity(centers[:, 0])[at]),
        **_messages(recording, at),
        'state': Packed(voxel_states(recording)),
        'area': Packed.between(area_ratios(readings, recording.sensors), 0.5, 1.5),
        'touch': Packed.between(
            readings_of('touch', readings, recording.sensors), 0.0, 1.0
        ),
        'actuation': Packed.between(recording.applied[at], -1.0, 1.0),
    }
    if thresholds is not None:
        arrays['threshold'] = Packed.fitting(_window_means(thresholds)[at])
    ordered = sorted(arrays.items(), key=lambda item: -item[1].raw.itemsize)
    return Frames(stride, dict(ordered), recording.poses.ground)


def voxel_states(recording: Recording) -> np.ndarray:
    """Return what became of each voxel's answer and message, (n_steps, n_voxels) uint8.

    It is the `Outcome` of the answer, plus `LATE` if the message came too late, plus `SILENT` if
    there is none.
    """
    states = recording.outcomes.copy()
    if recording.spikes is not None or recording.values is not None:
        states += LATE * recording.late.astype(np.uint8)
        states += SILENT * (~recording.heard & ~recording.late).astype(np.uint8)
    states[-1] = Outcome.IN_TIME  # no voxel answers the last step
    return states


def _shapes(poses: Poses, centers: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return (n_frames, n_voxels, 8) corners of the latest pose, relative to the centre."""
    shapes = poses.corners - centers[poses.steps][:, None, None]
    newest = np.maximum(np.searchsorted(poses.steps, at, side='right') - 1, 0)
    return shapes[newest].reshape(len(at), -1, 8)


def _window(n_steps: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the first step of the window around each step, and the one after its last."""
    steps = np.arange(n_steps)
    return np.maximum(steps - _WINDOW // 2, 0), np.minimum(steps + _WINDOW // 2, n_steps - 1) + 1


def _velocity(x: np.ndarray) -> np.ndarray:
    """Return the mean velocity [m/s] over the window around each of n positions [m]."""
    first, end = _window(len(x))
    return (x[end - 1] - x[first]) * CONTROL_RATE / np.maximum(end - 1 - first, 1)


def _window_means(numbers: np.ndarray) -> np.ndarray:
    """Return the mean of (n_steps, n_voxels) numbers over the window around each step.

    NaN is ignored; the mean is NaN if all numbers in the window are.
    """
    first, end = _window(len(numbers))
    known = np.isfinite(numbers)
    none = np.zeros((1, numbers.shape[1]))
    sums = np.cumsum(np.concatenate([none, np.where(known, numbers, 0.0)]), axis=0)
    counts = np.cumsum(np.concatenate([none, known]), axis=0)
    n = counts[end] - counts[first]
    return np.divide(sums[end] - sums[first], n, out=np.full(n.shape, np.nan), where=n > 0)


def _messages(recording: Recording, at: np.ndarray) -> dict[str, Packed]:
    """Return the messages of all control steps and, for spikes, the firing rates at the frames."""
    if recording.spikes is not None:
        trains = pack_trains(recording.spikes).astype(np.uint16)
        per_channel = recording.spikes.sum(axis=3).mean(axis=2) * CONTROL_RATE
        rates = _window_means(np.where(recording.heard, per_channel, np.nan))
        return {'messages': Packed(trains), 'rate': Packed.fitting(rates[at])}
    if recording.values is not None:
        return {'messages': Packed.between(recording.values, -1.0, 1.0)}
    return {}
