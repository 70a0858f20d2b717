"""Contacts of the square masses with the ground's polygons (Chipmunk's cpCollision, cpArbiter).

Where a square and a polygon overlap, they touch along the axis in which they overlap least, one of
the edges' normals (the separating-axis test; Munk2D finds the same axis by GJK and EPA). Of each
shape the edge that faces the other is clipped by the other's: up to two points of contact, each
with its normal impulse, friction impulse, and an impulse that mends the overlap and is forgotten
after the step. Points are told by the corners that made them, and take over the impulses that the
same point had, if mass and polygon touched in one of the last three steps.
"""

from sim_node.batched.group import (
    BIAS_SPIN,
    BIAS_X,
    BIAS_Y,
    BOX_GROWTH,
    COS,
    NX,
    NY,
    POLYGON,
    RANK,
    SIN,
    SLOP,
    SPIN,
    STAMP,
    TURN,
    VX,
    VY,
    WARM,
    X,
    Y,
)
from sim_node.compiled import compiled_part, inlined_part
from sim_node.lanes import any_lane, like, load, select, store

POINTS = 7, 17
"""First fields of a contact's two points, in the order in which they act."""

ARM_N, ARM_T, MASS_N, MASS_T, BIAS, BOUNCE, IMPULSE_N, IMPULSE_T, IMPULSE_BIAS, KEY = range(10)
"""Fields of a point: lever arms about the mass's centre and effective masses along normal and
tangent, velocity that mends the overlap, velocity to bounce off with, impulses, corners."""

_PERSISTENCE = 3
_TINY = 2.2250738585072014e-308  # keeps a division by zero finite, as in Munk2D


@compiled_part
def find_contacts(group):
    """Find all contacts at the present poses, prepare their points, and say in which order to act.

    Fills `schedule` with pairs (row of `contacts`, turn): all lanes of the row if turn < 0, else
    those whose TURN it is, for a mass that touches several polygons in some lane.
    """
    masses, boxes, contacts, in_use = group.masses, group.boxes, group.contacts, group.in_use
    now, slots, n = group.step_count[0], group.slots, 0
    for i in range(masses.shape[0]):
        for slot in range(slots):
            in_use[i * slots + slot] = False
        moved = _left_box(masses, boxes, group.half, i)
        met = _meet_ground(group, i, moved, now)
        if met == 0:
            continue
        crowded = _take_turns(contacts, in_use, slots, i, moved, now)
        for turn in range(met if crowded else 1):
            for row in range(i * slots, (i + 1) * slots):
                if in_use[row]:
                    group.schedule[n, 0] = row
                    group.schedule[n, 1] = turn if crowded else -1
                    n += 1
    group.scheduled[0] = n


@inlined_part
def _left_box(masses, boxes, half, i):
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


@inlined_part
def _meet_ground(group, i, moved, now):
    """Find and prepare the contacts of mass i; return how many slots are in use."""
    masses, contacts, polygons = group.masses, group.contacts, group.polygons
    first, last = _near_polygons(group, i)
    x, y = load(masses, i, X), load(masses, i, Y)
    c, s = load(masses, i, COS), load(masses, i, SIN)
    velocity = load(masses, i, VX), load(masses, i, VY), load(masses, i, SPIN)
    h = group.half
    reach = h * (abs(c) + abs(s))
    met = 0
    for p in range(first, last):
        # Everything relative to the mass's centre. Corners of the polygon: (x0, y0) and (x1, y1)
        # on top, left and right; (x0, y2) and (x1, y2) at the base.
        x0, x1 = polygons[p, 0] - x, polygons[p, 1] - x
        y0, y1 = polygons[p, 2] - y, polygons[p, 3] - y
        tx, ty = polygons[p, 5], polygons[p, 6]
        over_top = -(x0 * tx + y0 * ty) - h * (abs(c * tx + s * ty) + abs(c * ty - s * tx))
        over_left, over_right = x0 - reach, -x1 - reach
        touch = (over_top <= 0.0) & (over_left <= 0.0) & (over_right <= 0.0)
        if not any_lane(touch):
            continue
        y2 = polygons[p, 4] - y
        # The axis of least overlap, as the normal (nx, ny) out of the ground.
        nx, ny, gap = like(x, tx), like(x, ty), over_top
        nx, ny, gap = _wider((nx, ny, gap), (-1.0, 0.0, over_left))
        nx, ny, gap = _wider((nx, ny, gap), (1.0, 0.0, over_right))
        low, high = _extent(c, s, x0, x1, y0, y1, y2)
        nx, ny, gap = _wider((nx, ny, gap), (-c, -s, low - h))
        nx, ny, gap = _wider((nx, ny, gap), (c, s, -high - h))
        low, high = _extent(-s, c, x0, x1, y0, y1, y2)
        nx, ny, gap = _wider((nx, ny, gap), (s, -c, low - h))
        nx, ny, gap = _wider((nx, ny, gap), (-s, c, -high - h))
        touch = touch & (gap <= 0.0)
        if not any_lane(touch):
            continue

        # The mass's edge that faces the ground: outward normal q, from corner a to corner b.
        across, along = -(nx * c + ny * s), nx * s - ny * c
        sideways = abs(across) > abs(along)
        sign = select(sideways, select(across > 0.0, 1.0, -1.0), select(along > 0.0, 1.0, -1.0))
        qx, qy = sign * select(sideways, c, -s), sign * select(sideways, s, c)
        ax, ay, bx, by = h * (qx + qy), h * (qy - qx), h * (qx - qy), h * (qy + qx)
        corner_b = select(sideways, 2.0 - sign, 1.0 + sign)
        corner_a = select(corner_b == 0.0, 3.0, corner_b - 1.0)
        # The polygon's edge that faces the mass, from corner e to corner f, counter-clockwise.
        facing = nx * tx + ny * ty
        is_left, is_right = -nx > facing, nx > facing
        ex, ey = select(is_left, x0, x1), select(is_right, y2, select(is_left, y0, y1))
        fx, fy = select(is_right, x1, x0), select(is_right, y1, select(is_left, y2, y0))
        corner_e = select(is_left, 3.0, select(is_right, 1.0, 2.0))
        corner_f = select(is_left, 0.0, select(is_right, 2.0, 3.0))

        # Each end of an edge projected on the other edge, along the normal.
        at_a, at_b = ay * nx - ax * ny, by * nx - bx * ny
        at_e, at_f = ey * nx - ex * ny, fy * nx - fx * ny
        per_ab, per_ef = 1.0 / (at_b - at_a + _TINY), 1.0 / (at_f - at_e + _TINY)
        t, u = _clip((at_f - at_a) * per_ab), _clip((at_a - at_e) * per_ef)
        px, py = ax * (1.0 - t) + bx * t, ay * (1.0 - t) + by * t
        depth_p = nx * (px - ex * (1.0 - u) - fx * u) + ny * (py - ey * (1.0 - u) - fy * u)
        t, u = _clip((at_e - at_a) * per_ab), _clip((at_b - at_e) * per_ef)
        qx, qy = ax * (1.0 - t) + bx * t, ay * (1.0 - t) + by * t
        depth_q = nx * (qx - ex * (1.0 - u) - fx * u) + ny * (qy - ey * (1.0 - u) - fy * u)
        key_p, key_q = 4.0 * corner_a + corner_f, 4.0 * corner_b + corner_e
        touch = touch & ((depth_p <= 0.0) | (depth_q <= 0.0))
        if not any_lane(touch):
            continue

        row = i * group.slots + p % group.slots
        if not group.in_use[row]:
            group.in_use[row] = True
            met += 1
            for point in POINTS:  # lanes that do not touch must not act
                store(contacts, row, point + MASS_N, 0.0)
                store(contacts, row, point + MASS_T, 0.0)
            store(contacts, row, WARM, 0.0)
        age = now - load(contacts, row, STAMP)
        known = (load(contacts, row, POLYGON) == like(x, p)) & (age <= _PERSISTENCE)
        for field, value in (
            (WARM, select(known & (age == 1.0), 1.0, 0.0)), (POLYGON, like(x, p)),
            (STAMP, like(x, now)), (RANK, like(x, polygons[p, 7])), (NX, nx), (NY, ny),
        ):
            _put(contacts, row, field, touch, value)
        old = (
            _memory(contacts, row, POINTS[0], known),
            _memory(contacts, row, POINTS[1], known),
        )
        # Two points act in the order in which Munk2D finds them: its own shape first, which is
        # the mass in a step in which it got a new box, and the ground else.
        first_p = (
            select(moved, px, qx), select(moved, py, qy),
            select(moved, depth_p, depth_q), select(moved, key_p, key_q),
        )
        then_p = (
            select(moved, qx, px), select(moved, qy, py),
            select(moved, depth_q, depth_p), select(moved, key_q, key_p),
        )
        constants = group.per_rho, group.bias, group.restitution
        for point, found in ((POINTS[0], first_p), (POINTS[1], then_p)):
            _prepare(contacts, row, point, touch, nx, ny, found, old, velocity, constants)
    return met


@inlined_part
def _near_polygons(group, i):
    """Return the range of polygons that some lane's mass i may touch."""
    n = group.left_sides.shape[0]
    if n <= 3:
        return 0, n
    west, east = 1e300, -1e300
    x = group.mass_lanes[i, X]
    for lane in range(x.shape[0]):
        west, east = min(west, x[lane]), max(east, x[lane])
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
def _wider(best, other):
    """Return, lane by lane, of two axes (n_x, n_y, gap) the one with the wider gap."""
    wider = other[2] > best[2]
    return (
        select(wider, other[0], best[0]),
        select(wider, other[1], best[1]),
        select(wider, other[2], best[2]),
    )


@inlined_part
def _extent(ux, uy, x0, x1, y0, y1, y2):
    """Return the least and the greatest coordinate of the polygon's corners along axis u."""
    a, b = ux * x0, ux * x1
    p, q, r, s = a + uy * y0, b + uy * y1, a + uy * y2, b + uy * y2
    low, high = min(min(p, q), r), max(max(p, q), r)  # noqa: PLW3301 -- lanes come in pairs
    return min(low, s), max(high, s)


@inlined_part
def _clip(t):
    return max(min(t, like(t, 1.0)), like(t, 0.0))


@inlined_part
def _put(contacts, row, field, lanes, value):
    """Write a field of a contact in some lanes only."""
    store(contacts, row, field, select(lanes, value, load(contacts, row, field)))


@inlined_part
def _memory(contacts, row, point, known):
    """Return key (-1 where nothing is known), normal and friction impulse of a point."""
    return (
        select(known, load(contacts, row, point + KEY), -1.0),
        load(contacts, row, point + IMPULSE_N),
        load(contacts, row, point + IMPULSE_T),
    )


@inlined_part
def _prepare(contacts, row, point, touch, nx, ny, found, old, velocity, constants):
    """Write a point found at (x, y) from the mass's centre, by `depth` (negative) in the ground."""
    rx, ry, depth, key = found
    per_rho, bias, restitution = constants
    exists = depth <= 0.0
    arm_n, arm_t = (rx * ny - ry * nx) * per_rho, (rx * nx + ry * ny) * per_rho
    v_n = velocity[0] * nx + velocity[1] * ny + velocity[2] * arm_n
    jn = select(old[0][0] == key, old[0][1], 0.0)
    jt = select(old[0][0] == key, old[0][2], 0.0)
    jn, jt = select(old[1][0] == key, old[1][1], jn), select(old[1][0] == key, old[1][2], jt)
    mend = -bias * min(depth + SLOP, like(depth, 0.0))
    _put(contacts, row, point + ARM_N, touch, arm_n)
    _put(contacts, row, point + ARM_T, touch, arm_t)
    _put(contacts, row, point + MASS_N, touch, select(exists, 1.0 / (1.0 + arm_n * arm_n), 0.0))
    _put(contacts, row, point + MASS_T, touch, select(exists, 1.0 / (1.0 + arm_t * arm_t), 0.0))
    _put(contacts, row, point + BIAS, touch, mend)
    _put(contacts, row, point + BOUNCE, touch, v_n * restitution)
    _put(contacts, row, point + IMPULSE_N, touch, select(exists, jn, 0.0))
    _put(contacts, row, point + IMPULSE_T, touch, select(exists, jt, 0.0))
    _put(contacts, row, point + IMPULSE_BIAS, touch, like(depth, 0.0))
    _put(contacts, row, point + KEY, touch, select(exists, key, -1.0))


@inlined_part
def _take_turns(contacts, in_use, slots, i, moved, now):
    """Order the polygons that mass i touches, lane by lane; tell if there are several in one."""
    crowded = False
    for row in range(i * slots, (i + 1) * slots):
        if not in_use[row]:
            continue
        rank, touch = load(contacts, row, RANK), load(contacts, row, STAMP) == now
        turn = like(rank, 0.0)
        for other in range(i * slots, (i + 1) * slots):
            if other == row or not in_use[other]:
                continue
            others = load(contacts, other, RANK)
            both = touch & (load(contacts, other, STAMP) == now)
            crowded = crowded or any_lane(both)
            before = both & ((moved & (others < rank)) | (~moved & (others > rank)))
            turn = turn + select(before, 1.0, 0.0)
        store(contacts, row, TURN, turn)
    return crowded


@inlined_part
def _due(contacts, row, turn):
    """Return 1.0 in the lanes whose turn it is, else 0.0."""
    at = load(contacts, row, TURN)
    if turn < 0:
        return like(at, 1.0)
    return select(at == like(at, turn), 1.0, 0.0)


@compiled_part
def apply_contacts_of_last_step(group):
    """Start from the impulses of the last step, where mass and polygon touched in it."""
    contacts = group.contacts
    for k in range(group.scheduled[0]):
        row, turn = group.schedule[k, 0], group.schedule[k, 1]
        i = row // group.slots
        nx, ny = load(contacts, row, NX), load(contacts, row, NY)
        warm = load(contacts, row, WARM) * _due(contacts, row, turn)
        vx, vy = load(group.masses, i, VX), load(group.masses, i, VY)
        spin = load(group.masses, i, SPIN)
        for point in POINTS:
            jn = load(contacts, row, point + IMPULSE_N) * warm
            jt = load(contacts, row, point + IMPULSE_T) * warm
            vx += nx * jn - ny * jt
            vy += ny * jn + nx * jt
            spin += load(contacts, row, point + ARM_N) * jn
            spin += load(contacts, row, point + ARM_T) * jt
        store(group.masses, i, VX, vx)
        store(group.masses, i, VY, vy)
        store(group.masses, i, SPIN, spin)


@compiled_part
def push_contacts(group):
    """Let every contact act once: no velocity into the ground, friction up to mu times normal."""
    contacts, mu = group.contacts, group.friction
    for k in range(group.scheduled[0]):
        row, turn = group.schedule[k, 0], group.schedule[k, 1]
        i = row // group.slots
        nx, ny = load(contacts, row, NX), load(contacts, row, NY)
        vx, vy = load(group.masses, i, VX), load(group.masses, i, VY)
        spin = load(group.masses, i, SPIN)
        bx, by = load(group.masses, i, BIAS_X), load(group.masses, i, BIAS_Y)
        bias_spin = load(group.masses, i, BIAS_SPIN)
        due = _due(contacts, row, turn)
        for point in POINTS:
            arm_n = load(contacts, row, point + ARM_N)
            arm_t = load(contacts, row, point + ARM_T)
            mass_n = load(contacts, row, point + MASS_N) * due
            mass_t = load(contacts, row, point + MASS_T) * due
            v_n = nx * vx + ny * vy + arm_n * spin
            v_t = nx * vy - ny * vx + arm_t * spin
            b_n = nx * bx + ny * by + arm_n * bias_spin
            old = load(contacts, row, point + IMPULSE_BIAS)
            new = max(old + (load(contacts, row, point + BIAS) - b_n) * mass_n, 0.0)
            store(contacts, row, point + IMPULSE_BIAS, new)
            jb = new - old
            old = load(contacts, row, point + IMPULSE_N)
            new = max(old - (load(contacts, row, point + BOUNCE) + v_n) * mass_n, 0.0)
            store(contacts, row, point + IMPULSE_N, new)
            jn, most = new - old, mu * new
            old = load(contacts, row, point + IMPULSE_T)
            new = max(min(old - v_t * mass_t, most), -most)
            store(contacts, row, point + IMPULSE_T, new)
            jt = new - old
            bx, by, bias_spin = bx + nx * jb, by + ny * jb, bias_spin + arm_n * jb
            vx, vy = vx + (nx * jn - ny * jt), vy + (ny * jn + nx * jt)
            spin = spin + (arm_n * jn + arm_t * jt)
        store(group.masses, i, VX, vx)
        store(group.masses, i, VY, vy)
        store(group.masses, i, SPIN, spin)
        store(group.masses, i, BIAS_X, bx)
        store(group.masses, i, BIAS_Y, by)
        store(group.masses, i, BIAS_SPIN, bias_spin)
