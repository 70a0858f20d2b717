"""Contacts of the square masses with the ground's polygons (Chipmunk's cpArbiter).

A contact has up to two points. Each has a normal impulse, a friction impulse, and a bias impulse,
which corrects the overlap and is discarded after the step. A point is identified by the corners
that define it. If mass and polygon touched in one of the last three steps, it keeps the impulses
that the same point had then.
"""

from sim_node.batched.broad_phase import near_polygons, update_box
from sim_node.batched.springs import get_velocity, set_velocity
from sim_node.batched.state import BIAS_X, COS, NX, NY, POLYGON, RANK, SIN, STAMP, TURN, WARM, X, Y
from sim_node.model.collision import contact_points, gaps_of_ground, polygon_from, widest_gap
from sim_node.model.ground_polygons import QUERY_RANK
from sim_node.numerics.jit import compiled_part, inlined_part
from sim_node.numerics.lanes import any_lane, like, load, select, store

POINTS = 7, 17
"""First fields of the two points of a contact, in the order in which they are solved."""

ARM_N, ARM_T, MASS_N, MASS_T, BIAS, BOUNCE, IMPULSE_N, IMPULSE_T, IMPULSE_BIAS, KEY = range(10)
"""Fields of a point: lever arms about the mass's centre, divided by the radius of gyration, and
effective masses, along normal and tangent; bias velocity that corrects the overlap; velocity of
restitution; impulses; key of the corners that define the point."""

_PERSISTENCE = 3


@compiled_part
def find_contacts(group):
    """Find all contacts at the present poses, prepare their points and schedule them.

    Fills `schedule` with pairs (row of `contacts`, turn) in the order of solution: all lanes of the
    row if turn < 0, else the lanes whose TURN it is, for a mass that touches several polygons in
    some lane. Sets `deep` to whether there is any overlap to correct.
    """
    contacts, in_use = group.contacts, group.in_use
    now, slots, n = group.step_count[0], group.slots, 0
    group.deep[0] = False
    for i in range(group.masses.shape[0]):
        for slot in range(slots):
            in_use[i * slots + slot] = False
        renewed = update_box(group.masses, group.boxes, group.half, i)
        n_in_use = _find_ground_contacts(group, i, renewed, now)
        if n_in_use == 0:
            continue
        several = _assign_turns(contacts, in_use, slots, i, renewed, now)
        for turn in range(n_in_use if several else 1):
            for row in range(i * slots, (i + 1) * slots):
                if in_use[row]:
                    group.schedule[n, 0] = row
                    group.schedule[n, 1] = turn if several else -1
                    n += 1
    group.scheduled[0] = n


@inlined_part
def _find_ground_contacts(group, i, renewed, now):
    """Find and prepare the ground contacts of mass i; return how many slots are in use."""
    first, last = near_polygons(group, i)
    x, y = load(group.masses, i, X), load(group.masses, i, Y)
    mass = load(group.masses, i, COS), load(group.masses, i, SIN), group.half
    n_in_use = 0
    for p in range(first, last):
        polygon = polygon_from(group.polygons, p, x, y)
        gaps = gaps_of_ground(polygon, mass)
        touch = (gaps[0] <= 0.0) & (gaps[1] <= 0.0) & (gaps[2] <= 0.0)
        if not any_lane(touch):
            continue
        nx, ny, gap = widest_gap(polygon, mass, gaps)
        touch = touch & (gap <= 0.0)
        if not any_lane(touch):
            continue
        p_point, q_point = contact_points(polygon, mass, nx, ny)
        touch = touch & ((p_point[2] <= 0.0) | (q_point[2] <= 0.0))
        if not any_lane(touch):
            continue
        row = i * group.slots + p % group.slots
        if not group.in_use[row]:
            group.in_use[row] = True
            n_in_use += 1
            _clear_slot(group.contacts, row)
        # The two points are solved in the order in which Munk2D finds them. It starts from the
        # mass in a step in which the mass's box is renewed, else from the ground.
        one = _select_point(renewed, p_point, q_point)
        two = _select_point(renewed, q_point, p_point)
        _write_contact(group, i, row, p, touch, (nx, ny), one, two, now)
    return n_in_use


@inlined_part
def _clear_slot(contacts, row):
    """Clear a slot that comes into use, so that its contact has no effect in any lane."""
    store(contacts, row, WARM, 0.0)
    for point in POINTS:
        store(contacts, row, point + MASS_N, 0.0)
        store(contacts, row, point + MASS_T, 0.0)


@inlined_part
def _select_point(mask, a, b):
    """Return, lane by lane, point a where `mask` holds, else b."""
    return (
        select(mask, a[0], b[0]), select(mask, a[1], b[1]),
        select(mask, a[2], b[2]), select(mask, a[3], b[3]),
    )


@inlined_part
def _write_contact(group, i, row, p, touch, normal, one, two, now):
    """Write a contact of mass i with polygon p, and its old impulses, in the lanes of `touch`."""
    contacts, (nx, ny) = group.contacts, normal
    age = now - load(contacts, row, STAMP)
    known = (load(contacts, row, POLYGON) == p) & (age <= _PERSISTENCE)
    old = _impulses(contacts, row, POINTS[0], known), _impulses(contacts, row, POINTS[1], known)
    _write(contacts, row, WARM, touch, select(known & (age == 1.0), 1.0, 0.0))
    _write(contacts, row, POLYGON, touch, p)
    _write(contacts, row, STAMP, touch, now)
    _write(contacts, row, RANK, touch, group.polygons[p, QUERY_RANK])
    _write(contacts, row, NX, touch, nx)
    _write(contacts, row, NY, touch, ny)
    velocity = get_velocity(group.masses, i)
    _write_point(group, row, POINTS[0], touch, normal, one, old, velocity)
    _write_point(group, row, POINTS[1], touch, normal, two, old, velocity)


@inlined_part
def _write(contacts, row, field, lanes, value):
    """Write a field of a contact in the lanes of mask `lanes` only."""
    store(contacts, row, field, select(lanes, value, load(contacts, row, field)))


@inlined_part
def _impulses(contacts, row, point, known):
    """Return key (-1 in lanes that are not `known`), normal and friction impulse of a point."""
    return (
        select(known, load(contacts, row, point + KEY), -1.0),
        load(contacts, row, point + IMPULSE_N),
        load(contacts, row, point + IMPULSE_T),
    )


@inlined_part
def _write_point(group, row, point, touch, normal, found, old, velocity):
    """Write a contact point, with the impulses of the old point that has the same key."""
    contacts, (nx, ny), (rx, ry, depth, key) = group.contacts, normal, found
    exists = depth <= 0.0
    arm_n = (rx * ny - ry * nx) * group.inv_gyration_radius
    arm_t = (rx * nx + ry * ny) * group.inv_gyration_radius
    v_n = velocity[0] * nx + velocity[1] * ny + velocity[2] * arm_n
    jn = select(old[0][0] == key, old[0][1], 0.0)
    jt = select(old[0][0] == key, old[0][2], 0.0)
    jn, jt = select(old[1][0] == key, old[1][1], jn), select(old[1][0] == key, old[1][2], jt)
    overlap = min(depth + group.slop, 0.0)
    group.deep[0] = group.deep[0] or any_lane(touch & (overlap < 0.0))
    _write(contacts, row, point + ARM_N, touch, arm_n)
    _write(contacts, row, point + ARM_T, touch, arm_t)
    _write(contacts, row, point + MASS_N, touch, select(exists, 1.0 / (1.0 + arm_n * arm_n), 0.0))
    _write(contacts, row, point + MASS_T, touch, select(exists, 1.0 / (1.0 + arm_t * arm_t), 0.0))
    _write(contacts, row, point + BIAS, touch, -group.bias * overlap)
    _write(contacts, row, point + BOUNCE, touch, v_n * group.restitution)
    _write(contacts, row, point + IMPULSE_N, touch, select(exists, jn, 0.0))
    _write(contacts, row, point + IMPULSE_T, touch, select(exists, jt, 0.0))
    _write(contacts, row, point + IMPULSE_BIAS, touch, 0.0)
    _write(contacts, row, point + KEY, touch, select(exists, key, -1.0))


@inlined_part
def _assign_turns(contacts, in_use, slots, i, renewed, now):
    """Write the TURN of each contact of mass i, lane by lane.

    Returns:
        Whether the mass touches several polygons in some lane.
    """
    several = False
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
            several = several or any_lane(both)
            before = both & ((renewed & (others < rank)) | (~renewed & (others > rank)))
            turn = turn + select(before, 1.0, 0.0)
        store(contacts, row, TURN, turn)
    return several


@inlined_part
def _where_turn(contacts, row, turn, value):
    """Return `value` in the lanes whose turn it is, else 0."""
    if turn < 0:
        return value
    return select(load(contacts, row, TURN) == turn, value, 0.0)


@compiled_part
def warm_start_contacts(group):
    """Apply the impulses of the last step, in the lanes where mass and polygon touched in it."""
    contacts = group.contacts
    for k in range(group.scheduled[0]):
        row, turn = group.schedule[k, 0], group.schedule[k, 1]
        i = row // group.slots
        nx, ny = load(contacts, row, NX), load(contacts, row, NY)
        warm = _where_turn(contacts, row, turn, load(contacts, row, WARM))
        vx, vy, spin = get_velocity(group.masses, i)
        for point in POINTS:
            jn = load(contacts, row, point + IMPULSE_N) * warm
            jt = load(contacts, row, point + IMPULSE_T) * warm
            vx += nx * jn - ny * jt
            vy += ny * jn + nx * jt
            spin += load(contacts, row, point + ARM_N) * jn
            spin += load(contacts, row, point + ARM_T) * jt
        set_velocity(group.masses, i, (vx, vy, spin))


@compiled_part
def solve_contacts(group):
    """Solve every contact once: no velocity into the ground, friction up to mu times normal."""
    contacts, mu = group.contacts, group.friction
    for k in range(group.scheduled[0]):
        row, turn = group.schedule[k, 0], group.schedule[k, 1]
        i = row // group.slots
        nx, ny = load(contacts, row, NX), load(contacts, row, NY)
        vx, vy, spin = get_velocity(group.masses, i)
        for point in POINTS:
            arm_n = load(contacts, row, point + ARM_N)
            arm_t = load(contacts, row, point + ARM_T)
            mass_n = _where_turn(contacts, row, turn, load(contacts, row, point + MASS_N))
            mass_t = _where_turn(contacts, row, turn, load(contacts, row, point + MASS_T))
            v_n = nx * vx + ny * vy + arm_n * spin
            v_t = nx * vy - ny * vx + arm_t * spin
            old = load(contacts, row, point + IMPULSE_N)
            new = max(old - (load(contacts, row, point + BOUNCE) + v_n) * mass_n, 0.0)
            store(contacts, row, point + IMPULSE_N, new)
            jn, most = new - old, mu * new
            old = load(contacts, row, point + IMPULSE_T)
            new = max(min(old - v_t * mass_t, most), -most)
            store(contacts, row, point + IMPULSE_T, new)
            jt = new - old
            vx, vy = vx + (nx * jn - ny * jt), vy + (ny * jn + nx * jt)
            spin = spin + (arm_n * jn + arm_t * jt)
        set_velocity(group.masses, i, (vx, vy, spin))


@compiled_part
def solve_overlaps(group):
    """Compute the bias velocities, which move masses out of the ground beyond the slop.

    No other constraint changes these velocities, so all sweeps can be made at once.
    """
    contacts = group.contacts
    for sweep in range(group.iterations * group.scheduled[0] if group.deep[0] else 0):
        k = sweep % group.scheduled[0]
        row, turn = group.schedule[k, 0], group.schedule[k, 1]
        i = row // group.slots
        nx, ny = load(contacts, row, NX), load(contacts, row, NY)
        bx, by, bias_spin = get_velocity(group.masses, i, BIAS_X)
        for point in POINTS:
            arm_n = load(contacts, row, point + ARM_N)
            mass_n = _where_turn(contacts, row, turn, load(contacts, row, point + MASS_N))
            b_n = nx * bx + ny * by + arm_n * bias_spin
            old = load(contacts, row, point + IMPULSE_BIAS)
            new = max(old + (load(contacts, row, point + BIAS) - b_n) * mass_n, 0.0)
            store(contacts, row, point + IMPULSE_BIAS, new)
            j = new - old
            bx, by, bias_spin = bx + nx * j, by + ny * j, bias_spin + arm_n * j
        set_velocity(group.masses, i, (bx, by, bias_spin), BIAS_X)
