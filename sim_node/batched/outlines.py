"""The voxels' outlines, areas and contacts with the ground, which sensors read."""

from sim_node.batched.state import COS, SIN, STAMP, X, Y
from sim_node.model.sensing import begin_reading, end_reading, four_rows, measure_voxel
from sim_node.model.sensors import twice_area
from sim_node.numerics.jit import compiled_part, inlined_part
from sim_node.numerics.lanes import like, load, select, store


@inlined_part
def _observe_voxel(group, i):
    """Write the corners of voxel i, its area ratio, and whether it touches the ground."""
    area = _outline(group.masses, group.corners, group.half, i) / group.rest_area
    store(group.area_ratios, i, 0, area)
    now = group.step_count[0]
    store(group.touching, i, 0, _touching(group.contacts, group.in_use, group.slots, now, i))


@compiled_part
def observe(group):
    """Write the corners of all voxels, their area ratios, and whether they touch the ground."""
    for i in range(group.area_ratios.shape[0]):
        _observe_voxel(group, i)


@compiled_part
def observe_and_sense(group, sensing, step):
    """Observe all voxels and read their sensors at control step `step`, in one pass over them."""
    begin_reading(sensing, step)
    for i in range(group.area_ratios.shape[0]):
        _observe_voxel(group, i)
        measure_voxel(sensing, step, i)
    end_reading(sensing)


@inlined_part
def _outline(masses, corners, half, i):
    """Write the outer corners of voxel i and return its area [m^2]."""
    for j in range(4 * i, 4 * i + 4):
        sx = -half if j == 4 * i or j == 4 * i + 3 else half
        sy = half if j < 4 * i + 2 else -half
        c, s = load(masses, j, COS), load(masses, j, SIN)
        store(corners, j, 0, load(masses, j, X) + c * sx - s * sy)
        store(corners, j, 1, load(masses, j, Y) + s * sx + c * sy)
    return twice_area(four_rows(corners, i, 0), four_rows(corners, i, 1)) / 2.0


@inlined_part
def _touching(contacts, in_use, slots, now, i):
    """Return 1.0 where one of voxel i's masses touches the ground, else 0.0."""
    touching = like(load(contacts, 0, STAMP), 0.0)
    for row in range(4 * i * slots, 4 * (i + 1) * slots):
        if in_use[row]:
            touches = load(contacts, row, STAMP) == now
            touching = select(touches, 1.0, touching)
    return touching
