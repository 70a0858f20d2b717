"""The voxels' sensors in lanes, by the arithmetic of `sim_node.model.sensors`."""

from sim_node.batched.state import COS, SIN, STAMP, VX, VY, X, Y
from sim_node.model.sensors import (
    AREA_HIGH,
    AREA_LOW,
    MAX_AREA_RATIO,
    N_SENSORS,
    SPEED,
    TOUCH_WINDOW,
    VELOCITY_WINDOW,
    own_velocity,
    soft_normalise,
    twice_area,
)
from sim_node.numerics.jit import compiled_part, inlined_part
from sim_node.numerics.lanes import like, load, select, store


@compiled_part
def sense(group, step):
    """Read all sensors after control step `step`, and note which lanes are sane.

    A lane is not when one of its numbers is not finite or a voxel's area is beyond bounds.
    """
    masses, corners, contacts, in_use = group.masses, group.corners, group.contacts, group.in_use
    sane, now = like(load(masses, 0, X), 1.0), group.step_count[0]
    for i in range(group.area_ratios.shape[0]):
        area = _outline(masses, corners, group.half, i) / group.rest_area
        store(group.area_ratios, i, 0, area)
        sane = select(abs(area) < MAX_AREA_RATIO, sane, 0.0)
        touching = _touching(contacts, in_use, group.slots, now, i)
        store(group.touching, i, 0, touching)
        store(group.touches, i * TOUCH_WINDOW + step % TOUCH_WINDOW, 0, touching)
        along, across = own_velocity(
            _four(masses, i, X), _four(masses, i, Y), _four(masses, i, VX), _four(masses, i, VY)
        )
        newest = i * VELOCITY_WINDOW + step % VELOCITY_WINDOW
        store(group.velocities, newest, 0, along)
        store(group.velocities, newest, 1, across)
        store(group.readings, i, 0, soft_normalise(area, AREA_LOW, AREA_HIGH))
        n = min(step + 1, TOUCH_WINDOW)
        store(group.readings, i, 1, _sum(group.touches, i * TOUCH_WINDOW, n, 0) / n)
        n = min(step + 1, VELOCITY_WINDOW)
        for axis in range(2):
            mean = _sum(group.velocities, i * VELOCITY_WINDOW, n, axis) / n
            store(group.readings, i, 2 + axis, soft_normalise(mean, -SPEED, SPEED))
    for i in range(group.area_ratios.shape[0]):
        for sensor in range(N_SENSORS):
            sane = select(load(group.readings, i, sensor) <= 1.0, sane, 0.0)
    store(group.sane, 0, 0, sane)


@inlined_part
def _outline(masses, corners, half, i):
    """Write the outer corners of voxel i and return its area [m^2]."""
    for j in range(4 * i, 4 * i + 4):
        sx = -half if j == 4 * i or j == 4 * i + 3 else half
        sy = half if j < 4 * i + 2 else -half
        c, s = load(masses, j, COS), load(masses, j, SIN)
        store(corners, j, 0, load(masses, j, X) + c * sx - s * sy)
        store(corners, j, 1, load(masses, j, Y) + s * sx + c * sy)
    return twice_area(_four(corners, i, 0), _four(corners, i, 1)) / 2.0


@inlined_part
def _four(rows, i, field):
    """Return a field of voxel i's four rows."""
    j = 4 * i
    return (
        load(rows, j, field), load(rows, j + 1, field),
        load(rows, j + 2, field), load(rows, j + 3, field),
    )


@inlined_part
def _touching(contacts, in_use, slots, now, i):
    """Return 1.0 where one of voxel i's masses touches the ground, else 0.0."""
    touching = like(load(contacts, 0, STAMP), 0.0)
    for row in range(4 * i * slots, 4 * (i + 1) * slots):
        if in_use[row]:
            touches = load(contacts, row, STAMP) == now
            touching = select(touches, 1.0, touching)
    return touching


@inlined_part
def _sum(windows, first, n, field):
    total = like(load(windows, first, field), 0.0)
    for i in range(first, first + n):
        total += load(windows, i, field)
    return total
