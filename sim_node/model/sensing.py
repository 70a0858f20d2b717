"""Reading sensors, by the same compiled code for one robot and for robots in lanes.

The engine provides masses, area ratios and touching. Each sensor of each voxel has a ring buffer of
`window` samples of its measure; a reading is the mean of the samples so far, mapped to [0, 1].
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numba.extending import overload

from sim_node.model.sensors import MAX_AREA_RATIO, SENSORS, Voxel, check_sensors, soft_normalise
from sim_node.numerics.dispatch import INLINED, method
from sim_node.numerics.jit import compiled, compiled_kernel, inlined_part
from sim_node.numerics.lane_array import zeros
from sim_node.numerics.lanes import like, load, select, store

X, Y, VX, VY = 0, 1, 3, 4
"""Columns of masses, (n_masses, 5 or more); column 2 is the angle [rad]."""


class Sensing(NamedTuple):
    """The sensors of W robots of one shape, with their inputs, samples and readings."""

    sensors: tuple  # sensors of a voxel, of `SENSORS`
    windows: np.ndarray  # (n_sensors,) number of samples in the mean
    starts: np.ndarray  # (n_sensors,) index of a ring buffer in the samples of a voxel
    newest: np.ndarray  # (n_sensors,) index of the newest sample in the samples of a voxel
    masses: np.ndarray  # lanes (n_masses, 5 or more) x, y, angle, v_x, v_y
    area_ratios: np.ndarray  # lanes (n_voxels, 1)
    touching: np.ndarray  # lanes (n_voxels, 1) 0.0 or 1.0
    samples: np.ndarray  # lanes (n_voxels * sum of windows, 1)
    means: np.ndarray  # lanes (n_sensors * n_voxels, 1) of the samples, then the readings
    readings: np.ndarray  # lanes (n_voxels, n_sensors) in [0, 1]
    sane: np.ndarray  # lanes (1, 1) 0.0 where the physics diverged, else 1.0

    mean_lanes: np.ndarray  # (n_sensors, n_voxels * W) `means` as numbers, in the same memory
    reading_lanes: np.ndarray  # (n_voxels, n_sensors, W) `readings` as numbers
    sane_lanes: np.ndarray  # (1, 1, W) `sane` as numbers


def make_sensing(
    names: Sequence[str], masses: np.ndarray, area_ratios: np.ndarray, touching: np.ndarray
) -> Sensing:
    """Return the sensors of W robots before the first reading.

    Args:
        names: names of the sensors of each voxel, in the order of the readings.
        masses, area_ratios, touching: lane arrays of the engine, see `Sensing`; they are shared.

    Raises:
        InvalidInput: a name is not one of `SENSORS`.
    """
    sensors = tuple(SENSORS[name] for name in check_sensors(names))
    windows = np.array([sensor.window for sensor in sensors])
    n_voxels, width = len(area_ratios), masses['lane'].shape[2]
    readings, sane = zeros((n_voxels, len(sensors)), width), zeros((1, 1), width)
    means = zeros((len(sensors) * n_voxels, 1), width)
    return Sensing(
        sensors=sensors,
        windows=windows,
        starts=np.cumsum(windows) - windows,
        newest=np.zeros_like(windows),
        masses=masses,
        area_ratios=area_ratios,
        touching=touching,
        samples=zeros((n_voxels * int(windows.sum()), 1), width),
        means=means,
        readings=readings,
        sane=sane,
        mean_lanes=means['lane'].reshape(len(sensors), -1),
        reading_lanes=readings['lane'],
        sane_lanes=sane['lane'],
    )


class RobotSensing(NamedTuple):
    """The sensors of one robot, and arrays without lanes in the same memory."""

    sensing: Sensing  # with one lane
    masses: np.ndarray  # (n_masses, 5)
    area_ratios: np.ndarray  # (n_voxels,)
    touching: np.ndarray  # (n_voxels,)
    readings: np.ndarray  # (n_voxels, n_sensors)


def sensing_of_one(names: Sequence[str], n_voxels: int) -> RobotSensing:
    """Return the sensors of one robot of `n_voxels` voxels, before the first reading."""
    masses, ratios = zeros((4 * n_voxels, 5), 1), zeros((n_voxels, 1), 1)
    touching = zeros((n_voxels, 1), 1)
    sensing = make_sensing(names, masses, ratios, touching)
    return RobotSensing(
        sensing, masses['lane'][:, :, 0], ratios['lane'][:, 0, 0], touching['lane'][:, 0, 0],
        sensing.reading_lanes[:, :, 0],
    )


_measure = method('measure', 'Return the measure of a sensor for a voxel, a number or lanes.')


@inlined_part
def begin_reading(sensing, step):
    """Prepare to read all sensors at control step `step`, which begins at 0 and increases by 1."""
    for j in range(sensing.windows.shape[0]):
        sensing.newest[j] = sensing.starts[j] + step % sensing.windows[j]


@inlined_part
def measure_voxel(sensing, step, i):
    """Store the measures of voxel i, and the means of its samples."""
    masses = sensing.masses
    voxel = Voxel(
        four_rows(masses, i, X), four_rows(masses, i, Y),
        four_rows(masses, i, VX), four_rows(masses, i, VY),
        load(sensing.area_ratios, i, 0), load(sensing.touching, i, 0),
    )
    first = i * (sensing.samples.shape[0] // sensing.area_ratios.shape[0])
    _measure_each(sensing.sensors, 0, sensing, first, voxel)
    _average(sensing, step, i, first)


@inlined_part
def end_reading(sensing):
    """Write the readings of all voxels, and `sane`: in which lanes the physics has not diverged.

    It has diverged if a reading is not finite or a voxel's area exceeds `MAX_AREA_RATIO`.
    """
    n_voxels, n_sensors = sensing.readings.shape
    _normalise_each(sensing.sensors, 0, sensing.mean_lanes)
    sane = like(load(sensing.area_ratios, 0, 0), 1.0)
    for i in range(n_voxels):
        sane = select(abs(load(sensing.area_ratios, i, 0)) < MAX_AREA_RATIO, sane, 0.0)
        for j in range(n_sensors):
            reading = load(sensing.means, j * n_voxels + i, 0)
            store(sensing.readings, i, j, reading)
            sane = select(reading <= 1.0, sane, 0.0)
    store(sensing.sane, 0, 0, sane)


@compiled
def sense_robot(robot, masses, area_ratios, touching, step):
    """Read the sensors of one robot.

    Args:
        robot: `RobotSensing` of the robot.
        masses, area_ratios, touching: arrays of its engine, which are copied.
        step: control step.

    Returns:
        False if the physics diverged, see `end_reading`.
    """
    robot.masses[:] = masses[:, :5]
    robot.area_ratios[:] = area_ratios
    robot.touching[:] = touching
    begin_reading(robot.sensing, step)
    for i in range(area_ratios.shape[0]):
        measure_voxel(robot.sensing, step, i)
    end_reading(robot.sensing)
    return robot.sensing.sane_lanes[0, 0, 0] > 0.0


@inlined_part
def four_rows(rows, i, field):
    """Return a field of the four rows (masses or corners) of voxel i, as lanes."""
    j = 4 * i
    return (
        load(rows, j, field), load(rows, j + 1, field),
        load(rows, j + 2, field), load(rows, j + 3, field),
    )


def _measure_each(sensors, j, sensing, first, voxel):
    """Store the measures of the sensors from index j on for a voxel.

    The compiled code handles the first sensor and calls itself with the others; the recursion is
    over types, since each sensor has its own.

    Args:
        sensors: the sensors from index j on.
        first: first row of the voxel in the samples.
    """
    raise NotImplementedError('called by compiled code only')


@overload(_measure_each, jit_options=INLINED)
def _compiled_measure_each(sensors, j, sensing, first, voxel):
    if len(sensors) == 0:
        return lambda sensors, j, sensing, first, voxel: None

    def measure(sensors, j, sensing, first, voxel):
        store(sensing.samples, first + sensing.newest[j], 0, _measure(sensors[0], voxel))
        _measure_each(sensors[1:], j + 1, sensing, first, voxel)

    return measure


@inlined_part
def _average(sensing, step, i, first):
    """Write the means of voxel i's samples; in the first steps there are less than a window."""
    samples, n_voxels = sensing.samples, sensing.area_ratios.shape[0]
    for j in range(sensing.windows.shape[0]):
        start = first + sensing.starts[j]
        n = min(step + 1, sensing.windows[j])
        total = like(load(samples, start, 0), 0.0)
        for row in range(start, start + n):
            total += load(samples, row, 0)
        store(sensing.means, j * n_voxels + i, 0, total / n)


def _normalise_each(sensors, j, means):
    """Map the means of the sensors from index j on to [0, 1].

    Args:
        sensors: the sensors from index j on.
        means: (n_sensors, n_voxels * W), modified.
    """
    raise NotImplementedError('called by compiled code only')


@overload(_normalise_each, jit_options=INLINED)
def _compiled_normalise_each(sensors, j, means):
    if len(sensors) == 0:
        return lambda sensors, j, means: None
    soft = 'low' in sensors[0].instance_class._fields

    def normalise_soft(sensors, j, means):
        _normalise_row(means, j, sensors[0].low, sensors[0].high)
        _normalise_each(sensors[1:], j + 1, means)

    def clip(sensors, j, means):
        _clip_row(means, j)
        _normalise_each(sensors[1:], j + 1, means)

    return normalise_soft if soft else clip


@compiled_kernel
def _normalise_row(means, j, low, high):
    for i in range(means.shape[1]):  # numbers, not lanes: they vectorise for one robot, too
        means[j, i] = soft_normalise(means[j, i], low, high)


@compiled_kernel
def _clip_row(means, j):
    """Clip the means of sensor j to [0, 1]; NaN stays NaN."""
    for i in range(means.shape[1]):
        mean = means[j, i]
        means[j, i] = 0.0 if mean < 0.0 else 1.0 if mean > 1.0 else mean


@compiled
def add_noise(readings, noise):
    """Add `noise`, of the shape of the readings or with 0 voxels, to the readings; clip to [0, 1].

    Args:
        readings: (n_voxels, n_sensors) of one robot or (n_voxels, n_sensors, W) of W robots.
        noise: the noise.
    """
    for i in np.ndindex(noise.shape):
        readings[i] = min(max(readings[i] + noise[i], 0.0), 1.0)
