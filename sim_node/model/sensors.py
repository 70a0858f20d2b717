"""A voxel's sensors: area, touch and velocity, read from its masses, as numbers in [0, 1].

Each kernel works on one voxel's slice of the world's arrays.
"""

import math

import numpy as np

from sim_node.numerics.elementary_functions import sine_cosine, tanh
from sim_node.numerics.jit import compiled, compiled_inline, compiled_kernel

SENSORS = ('area', 'touch', 'velocity_x', 'velocity_y')
"""Names of the readings, in their order."""

N_SENSORS = len(SENSORS)

TOUCH_WINDOW, VELOCITY_WINDOW = 15, 30
"""Control steps over which touch (0.25 s) and velocity (0.5 s) are averaged at 60 Hz."""

AREA_LOW, AREA_HIGH = 0.5, 1.5
"""Area, relative to rest, that is mapped softly to [0, 1]."""

SPEED = 8.0
"""Speed [m/s] whose range, to and fro, is mapped softly to [0, 1]."""


MAX_AREA_RATIO = 100.0
"""A voxel larger than this, relative to rest, has left all bounds."""


@compiled_inline
def soft_normalise(value, low, high):
    """Map [low, high] softly to [0, 1] (2D-VSR-Sim): tanh((2 u - 1) 2) / 2 + 1/2, u linear.

    A number or lanes.
    """
    u = (value - low) / (high - low)
    return tanh((2.0 * u - 1.0) * 2.0) / 2.0 + 0.5


@compiled_inline
def twice_area(x, y):
    """Return twice the area of a voxel from its corners' x and y, 4-tuples NW, NE, SE, SW.

    Numbers or lanes.
    """
    total = x[1] * y[0] - x[0] * y[1]
    total = total + (x[2] * y[1] - x[1] * y[2])
    total = total + (x[3] * y[2] - x[2] * y[3])
    return total + (x[0] * y[3] - x[3] * y[0])


@compiled
def polygon_area(corners):
    """Return the area [m^2] of a voxel from its (4, 2) corners [m] NW, NE, SE, SW."""
    return twice_area(_column(corners, 0), _column(corners, 1)) / 2.0


@compiled_inline
def _column(rows, j):
    return rows[0, j], rows[1, j], rows[2, j], rows[3, j]


@compiled_kernel
def outer_corners(masses, half_side, corners):
    """Write the (4 n_voxels, 2) outer corners [m] of voxels.

    Args:
        masses: (4 n_voxels, 5) x, y, angle, v_x, v_y of the masses NW, NE, SE, SW of each voxel.
        half_side: half the side of a mass [m].
    """
    for i in range(masses.shape[0]):
        corner = i & 3
        sx = -half_side if corner == 0 or corner == 3 else half_side
        sy = half_side if corner < 2 else -half_side
        s, c = sine_cosine(masses[i, 2])
        corners[i, 0] = masses[i, 0] + c * sx - s * sy
        corners[i, 1] = masses[i, 1] + s * sx + c * sy


@compiled_inline
def own_velocity(x, y, vx, vy):
    """Return the mean velocity (along, across) [m/s] of one voxel's masses in its own axes.

    The voxel's x axis points along the mean direction of its top and its bottom side. Arguments are
    4-tuples of the masses NW, NE, SE, SW: numbers or lanes.
    """
    top_x, top_y = x[1] - x[0], y[1] - y[0]
    low_x, low_y = x[2] - x[3], y[2] - y[3]
    top, low = math.sqrt(top_x * top_x + top_y * top_y), math.sqrt(low_x * low_x + low_y * low_y)
    axis_x, axis_y = top_x / top + low_x / low, top_y / top + low_y / low
    length = math.sqrt(axis_x * axis_x + axis_y * axis_y)
    c, s = axis_x / length, axis_y / length
    mean_vx, mean_vy = (vx[0] + vx[1] + vx[2] + vx[3]) / 4.0, (vy[0] + vy[1] + vy[2] + vy[3]) / 4.0
    return c * mean_vx + s * mean_vy, c * mean_vy - s * mean_vx


@compiled
def window_means(windows, step):
    """Return the means of the two rows of a (2, n) ring buffer that saw `step` + 1 samples."""
    n = min(step + 1, windows.shape[1])
    first = second = 0.0
    for i in range(n):  # side by side, for neither sum has to wait for the other
        first += windows[0, i]
        second += windows[1, i]
    return first / n, second / n


@compiled
def measure(voxel, step, touching, area_ratio, touches, velocities, measures):
    """Write one voxel's four measures (paper, section 2.1; 2D-VSR-Sim's averages).

    Args:
        voxel: (4, 5) rows of the voxel's masses.
        step: control step, 0 at the reset.
        touching: 1.0 if one of the masses touches the ground, else 0.0.
        area_ratio: area over area at rest.
        touches: (TOUCH_WINDOW,) ring buffer, written.
        velocities: (2, VELOCITY_WINDOW) ring buffers, written.
        measures: (4,) in the order of `SENSORS`, written: area ratio, share of touching steps,
            mean velocities [m/s].
    """
    touches[step % TOUCH_WINDOW] = touching
    along, across = own_velocity(
        _column(voxel, 0), _column(voxel, 1), _column(voxel, 3), _column(voxel, 4)
    )
    velocities[0, step % VELOCITY_WINDOW] = along
    velocities[1, step % VELOCITY_WINDOW] = across
    measures[0] = area_ratio
    n = min(step + 1, TOUCH_WINDOW)
    measures[1] = touches[:n].sum() / n  # whole numbers: exact in any order
    measures[2], measures[3] = window_means(velocities, step)


@compiled_kernel
def normalise(readings):
    """Turn all voxels' measures, (4 n_voxels,), into readings in [0, 1], in place."""
    for i in range(readings.shape[0]):  # no branch: it vectorises
        sensor, value = i & 3, readings[i]
        low = AREA_LOW if sensor == 0 else -SPEED
        high = AREA_HIGH if sensor == 0 else SPEED
        readings[i] = value if sensor == 1 else soft_normalise(value, low, high)


@compiled
def center_of_mass(masses):
    """Return a robot's centre of mass (x, y) [m] from its (n_masses, 5) rows, all of one weight."""
    x = y = 0.0
    for i in range(masses.shape[0]):
        x += masses[i, 0]
        y += masses[i, 1]
    return x / masses.shape[0], y / masses.shape[0]


@compiled
def add_noise(readings, noise):
    """Add `noise`, (n_voxels, 4) or (0, 4), to the readings and clip them to [0, 1]."""
    for i in range(noise.shape[0]):
        for j in range(noise.shape[1]):
            readings[i, j] = min(max(readings[i, j] + noise[i, j], 0.0), 1.0)


def sample_windows(n_voxels: int) -> tuple[np.ndarray, np.ndarray]:
    """Return empty ring buffers for touch (n, TOUCH_WINDOW) and velocity (n, 2, ...)."""
    return np.zeros((n_voxels, TOUCH_WINDOW)), np.zeros((n_voxels, 2, VELOCITY_WINDOW))
