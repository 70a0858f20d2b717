"""The broad phase: which polygons a mass may touch, and when Munk2D meets them anew (cpBBTree)."""

from sim_node.batched.state import BOX_GROWTH, COS, SIN, VX, VY, X, Y
from sim_node.numerics.jit import inlined_part
from sim_node.numerics.lanes import any_lane, load, select, store


@inlined_part
def near_polygons(group, i):
    """Return the range of polygons that some lane's mass i may touch."""
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
def left_box(masses, boxes, half, i):
    """Tell in which lanes a mass has left its box of the broad phase, and give it a new one.

    Munk2D meets a mass's neighbours in one order in the step in which it gets a new box, and in
    the reverse order in the steps after that (cpBBTree.c): the order in which contacts act.
    """
    x, y = load(masses, i, X), load(masses, i, Y)
    reach = half * (abs(load(masses, i, COS)) + abs(load(masses, i, SIN)))
    left, bottom, right, top = x - reach, y - reach, x + reach, y + reach
    inside = (
        (load(boxes, i, 0) <= left) & (load(boxes, i, 1) <= bottom)
        & (load(boxes, i, 2) >= right) & (load(boxes, i, 3) >= top)
    )
    moved = ~inside
    if any_lane(moved):
        ahead_x = load(masses, i, VX) * BOX_GROWTH
        ahead_y = load(masses, i, VY) * BOX_GROWTH
        room_x, room_y = (right - left) * BOX_GROWTH, (top - bottom) * BOX_GROWTH
        for side, new in (
            (0, left + min(-room_x, ahead_x)), (1, bottom + min(-room_y, ahead_y)),
            (2, right + max(room_x, ahead_x)), (3, top + max(room_y, ahead_y)),
        ):
            store(boxes, i, side, select(moved, new, load(boxes, i, side)))
    return moved
