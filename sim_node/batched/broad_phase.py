"""The broad phase: candidate polygons of each mass, and its enlarged bounding box (cpBBTree)."""

from sim_node.batched.state import BOX_GROWTH, COS, SIN, VX, VY, X, Y
from sim_node.numerics.jit import inlined_part
from sim_node.numerics.lanes import any_lane, load, select, store


@inlined_part
def near_polygons(group, i):
    """Return (first, end), the range of polygons that mass i may touch in at least one lane."""
    n = group.left_sides.shape[0]
    if n <= 3:
        return 0, n
    west, east = 1e300, -1e300
    for lane in range(group.mass_lanes.shape[2]):
        x = group.mass_lanes[i, X, lane]
        west, east = min(west, x), max(east, x)
    reach = 1.5 * group.half  # more than half a diagonal
    first = _before(group.left_sides, west - reach)
    return max(0, first), _before(group.left_sides, east + reach) + 1


@inlined_part
def _before(values, x):
    """Return the index of the last of increasing `values` that is not above x, or -1."""
    low, high = 0, values.shape[0]
    while low < high:
        middle = (low + high) // 2
        if values[middle] <= x:
            low = middle + 1
        else:
            high = middle
    return low - 1


@inlined_part
def update_box(masses, boxes, half, i):
    """Renew the box of mass i where the mass is no longer inside; return the mask of those lanes.

    Munk2D finds the contacts of a mass in one order in the step in which its box is renewed, and
    in the reverse order in the following steps (cpBBTree.c). Contacts are solved in that order.
    """
    x, y = load(masses, i, X), load(masses, i, Y)
    reach = half * (abs(load(masses, i, COS)) + abs(load(masses, i, SIN)))
    left, bottom, right, top = x - reach, y - reach, x + reach, y + reach
    inside = (
        (load(boxes, i, 0) <= left) & (load(boxes, i, 1) <= bottom)
        & (load(boxes, i, 2) >= right) & (load(boxes, i, 3) >= top)
    )
    renewed = ~inside
    if any_lane(renewed):
        ahead_x = load(masses, i, VX) * BOX_GROWTH
        ahead_y = load(masses, i, VY) * BOX_GROWTH
        margin_x, margin_y = (right - left) * BOX_GROWTH, (top - bottom) * BOX_GROWTH
        for side, new in (
            (0, left + min(-margin_x, ahead_x)), (1, bottom + min(-margin_y, ahead_y)),
            (2, right + max(margin_x, ahead_x)), (3, top + max(margin_y, ahead_y)),
        ):
            store(boxes, i, side, select(renewed, new, load(boxes, i, side)))
    return renewed
