"""Measures the gait of a recorded walk: velocity, frequencies and firing rates."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from sim_node.control_time import CONTROL_RATE, steps_in
from sim_node.model.sensors import DEFAULT_SENSORS, SENSORS
from sim_node.walls import Walls
from snca_ros.cell.coding import SNN_STEPS
from snca_ros.evolution.episode import TRANSIENT, mean_velocity

VIBRATION = 8.0
"""Frequency [Hz] above which actuation counts as vibration: periods below 7.5 control steps."""


class Walk(Protocol):
    """A walk whose gait can be measured: a `Recording` of a bag, or a `RecordedEpisode`."""

    @property
    def centers(self) -> np.ndarray:
        """Return the centre of mass x, y [m] at each control step, (n, 2)."""

    @property
    def walls(self) -> Walls:
        """Return the walls that the robot met."""

    @property
    def applied(self) -> np.ndarray:
        """Return the actuation that moved the body, (n_steps, n_voxels)."""

    @property
    def spikes(self) -> np.ndarray | None:
        """Return the spikes, (n_steps, n_voxels, n_channels, 16); None if the cells send none."""

    @property
    def heard(self) -> np.ndarray:
        """Return which spikes came in time to be used, (n_steps, n_voxels)."""


@dataclass(frozen=True, eq=False)
class Gait:
    """Measures of a walk.

    Attributes:
        velocity: mean v_x [m/s] after the transient; of the whole walk if it is shorter. It is
            measured until the robot meets the wall at the end of the ground.
        distance: between the first and the last position of the centre, in x [m].
        duration: between the first and the last control step [s].
        firing_rates: (n_voxels,) mean rate of the channels that a voxel sends [Hz]; None if the
            cells do not spike.
        frequencies: (n_voxels,) dominant frequency of the actuation [Hz]; 0 if it is constant.
        frequency: dominant frequency of the summed power of all voxels [Hz].
        walls: walls that the robot met. Frequencies are measured as `velocity` is.
        scored: the part of the walk that has this velocity, as text.
    """

    velocity: float
    distance: float
    duration: float
    firing_rates: np.ndarray | None
    frequencies: np.ndarray
    frequency: float
    walls: Walls
    scored: str


def walked_velocity(x: np.ndarray, transient: float = TRANSIENT) -> float:
    """Return the mean v_x [m/s] after `transient` seconds; of the whole walk if it is shorter.

    Args:
        x: (n,) position of the centre [m], one per control step from step 0; gaps (NaN) are
            interpolated.

    Returns:
        The velocity; NaN if no position is known.
    """
    if not np.isfinite(x).any():
        return math.nan
    first, last = _ends(x)
    walked = bridge_gaps(x[first : last + 1])
    return mean_velocity(walked, max(0, steps_in(transient) - first) / CONTROL_RATE)


def _ends(x: np.ndarray) -> tuple[int, int]:
    """Return the first and the last control step at which `x` is known."""
    known = np.flatnonzero(np.isfinite(x))
    return int(known[0]), int(known[-1])


def measure_gait(recording: Walk) -> Gait:
    """Return the gait of a recorded walk."""
    x = recording.centers[:, 0]
    first, last = _ends(x)
    walls = recording.walls
    is_long = len(walls.free_part(x[: last + 1])) > steps_in(TRANSIENT) + 1
    steady = steady_part(walls.free_part(recording.applied))
    rates = None
    if recording.spikes is not None:
        rates = firing_rates(recording.spikes, recording.heard)
    return Gait(
        velocity=walked_velocity(walls.free_part(x)),
        distance=float(x[last] - x[first]),
        duration=(last - first) / CONTROL_RATE,
        firing_rates=rates,
        frequencies=peak_frequency(power_spectrum(steady), len(steady)),
        frequency=dominant_frequency(steady),
        walls=walls,
        scored=f'after the first {TRANSIENT:g} s' if is_long else 'whole walk',
    )



def steady_part(actuation: np.ndarray, transient: float = TRANSIENT) -> np.ndarray:
    """Return the (n_steps, n_voxels) actuation after the transient [s]; all of it if it is shorter.

    Gaps (NaN) are interpolated.
    """
    known = np.flatnonzero(np.isfinite(actuation).any(axis=1))
    actuation = bridge_gaps(actuation[: known[-1] + 1 if len(known) else 1])
    first = steps_in(transient)
    return actuation[first if len(actuation) > first + 1 else 0 :]


def dominant_frequency(actuation: np.ndarray) -> float:
    """Return the frequency [Hz] at which the summed power of all voxels peaks, or 0.

    It is 0 where the actuation is constant but for rounding errors.

    Args:
        actuation: (n_steps, n_voxels), without gaps.
    """
    power = power_spectrum(actuation).sum(axis=1, keepdims=True)
    return float(peak_frequency(power, len(actuation))[0])


def vibration_share(actuation: np.ndarray) -> float:
    """Return the share of the summed power of all voxels that is above `VIBRATION`, 0 to 1.

    It is 0 where the actuation is constant but for rounding errors.

    Args:
        actuation: (n_steps, n_voxels), without gaps.
    """
    n = len(actuation)
    power = power_spectrum(actuation).sum(axis=1)
    if not _oscillates(power, n):
        return 0.0
    if n % 2 == 0:
        power[-1] /= 2.0  # rfft omits the mirror image of every other frequency
    fast = np.arange(len(power)) * CONTROL_RATE / n > VIBRATION
    return float(power[fast].sum() / power.sum())


def bridge_gaps(signal: np.ndarray) -> np.ndarray:
    """Return (n_steps, ...) numbers with every NaN replaced by linear interpolation over steps.

    Before the first and after the last finite number, that number is repeated. A column without
    finite numbers becomes 0.
    """
    if np.isfinite(signal).all():
        return signal
    out, steps = np.zeros_like(signal), np.arange(len(signal))
    for column in np.ndindex(signal.shape[1:]):
        at = (slice(None), *column)
        known = np.isfinite(signal[at])
        if known.any():
            out[at] = np.interp(steps, steps[known], signal[at][known])
    return out


def firing_rates(spikes: np.ndarray, heard: np.ndarray) -> np.ndarray:
    """Return the mean firing rate of each voxel's channels, (n_voxels,) [Hz].

    Args:
        spikes: (n_steps, n_voxels, n_channels, 16), 0 or 1.
        heard: (n_steps, n_voxels) which of them are known; the rate of a voxel with none is NaN.
    """
    counts = np.where(heard[:, :, None, None], spikes, 0).sum(axis=(0, 3)).mean(axis=1)
    seconds = heard.sum(axis=0) / CONTROL_RATE
    return np.divide(counts, seconds, out=np.full(len(counts), np.nan), where=seconds > 0)


def power_spectrum(signal: np.ndarray) -> np.ndarray:
    """Return the power of (n_steps, n) signals without their linear trends, (n_steps//2 + 1, n).

    Row i belongs to i periods in n_steps.
    """
    n = len(signal)
    time = np.arange(n) - (n - 1) / 2.0
    signal = signal - signal.mean(axis=0)
    slope = time @ signal / max(time @ time, 1.0)
    power = np.abs(np.fft.rfft(signal - np.outer(time, slope), axis=0)) ** 2
    power[0] = 0.0
    return power


def peak_frequency(power: np.ndarray, n_steps: int) -> np.ndarray:
    """Return the frequency [Hz] at which each column of a `power_spectrum` peaks.

    It is 0 where the signal is constant but for rounding errors.
    """
    peak = power.argmax(axis=0)
    frequency = peak * CONTROL_RATE / max(n_steps, 1)
    return np.where(_oscillates(power, n_steps), frequency, 0.0)


def _oscillates(power: np.ndarray, n_steps: int) -> np.ndarray:
    """Return which columns of a `power_spectrum` hold more than rounding errors."""
    return power.max(axis=0) > (1e-9 * n_steps) ** 2


def readings_of(sensor: str, readings: np.ndarray, sensors: Sequence[str]) -> np.ndarray:
    """Return the readings of one sensor, (...); NaN if the voxels have no such sensor.

    Args:
        sensor: its name.
        readings: (..., n_sensors).
        sensors: names of all, in the order of the readings.
    """
    if sensor not in sensors:
        return np.full(readings.shape[:-1], np.nan)
    return readings[..., list(sensors).index(sensor)]


def area_ratios(readings: np.ndarray, sensors: Sequence[str] = DEFAULT_SENSORS) -> np.ndarray:
    """Return the voxels' area over area at rest from their readings, (...).

    The inverse of the sensor's soft normalisation; a reading at the very end of its range stands
    for all beyond it. NaN if the voxels have no sensor of their area.

    Args:
        readings: (..., n_sensors).
        sensors: names of all, in the order of the readings.
    """
    inside = np.clip(readings_of('area', readings, sensors), 1e-12, 1.0 - 1e-12)
    u = (np.arctanh(2.0 * inside - 1.0) / 2.0 + 1.0) / 2.0
    low, high = SENSORS['area'].low, SENSORS['area'].high
    return low + (high - low) * u


def spike_times(spikes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return time [s] and row of every spike; row = voxel * n_channels + channel.

    Args:
        spikes: (n_steps, n_voxels, n_channels, 16).
    """
    step, voxel, channel, h = np.nonzero(spikes)
    return (step + h / SNN_STEPS) / CONTROL_RATE, voxel * spikes.shape[2] + channel
