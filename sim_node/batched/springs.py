"""Springs, explicit (Chipmunk's cpDampedSpring) or implicit (a soft constraint, as in dyn4j).

An explicit spring pulls once before a step, and its damping acts in the sweeps. Of an implicit one
both act in the sweeps, by the same arithmetic: `sim_node.munk2d.soft_spring` derives it.
"""

import math

from sim_node.batched.state import COS, N_SPRINGS, SIN, VX, X, Y
from sim_node.numerics.elementary_functions import expm1
from sim_node.numerics.jit import compiled_part, inlined_part
from sim_node.numerics.lanes import load, select, store

_NX, _NY, _ARM_A, _ARM_B, _SHARE, _PULL, _TARGET, _ELASTIC = range(8)
"""Fields: unit vector from a to b, lever arms about the masses' centres, share of the excess of the
relative velocity that a sweep takes and the impulse that does it, relative velocity to be left;
of an implicit spring, impulse of its extension in an explicit step."""


@inlined_part
def anchor(masses, i, ax, ay):
    """Return where an anchor [m] in the axes of mass i points in the world's axes."""
    c, s = load(masses, i, COS), load(masses, i, SIN)
    return c * ax - s * ay, s * ax + c * ay


@inlined_part
def get_velocity(masses, i, first=VX):
    """Return (v_x, v_y, rho times the angular velocity) of mass i.

    From BIAS_X on that is the velocity which mends overlaps.
    """
    return load(masses, i, first), load(masses, i, first + 1), load(masses, i, first + 2)


@inlined_part
def set_velocity(masses, i, velocity, first=VX):
    """Write what `get_velocity` returns."""
    store(masses, i, first, velocity[0])
    store(masses, i, first + 1, velocity[1])
    store(masses, i, first + 2, velocity[2])


@compiled_part
def stretch_springs(group):
    """Prepare every explicit spring at the present poses and apply its force for the step."""
    springs, table = group.springs, group.spring_table
    for k in range(springs.shape[0]):
        extension, stiff = _lie(group, k)
        drag = -expm1(max(-table[k, 8] * stiff, -700.0))
        store(springs, k, _SHARE, drag)
        store(springs, k, _PULL, drag / stiff)
        store(springs, k, _TARGET, 0.0)
        _push(group, k, -extension * table[k, 7])


@compiled_part
def soften_springs(group):
    """Prepare every implicit spring at the present poses; start from the last step's impulse."""
    springs, table = group.springs, group.spring_table
    for k in range(springs.shape[0]):
        softness = table[k, 9]
        impulse = load(springs, k, _TARGET) * (-1.0 / softness) - load(springs, k, _ELASTIC)
        extension, stiff = _lie(group, k)
        elastic, per_sum = extension * table[k, 7], 1.0 / (stiff + softness)
        store(springs, k, _SHARE, stiff * per_sum)
        store(springs, k, _PULL, per_sum)
        store(springs, k, _TARGET, -softness * (elastic + impulse))
        store(springs, k, _ELASTIC, elastic)
        _push(group, k, impulse)


@inlined_part
def _lie(group, k):
    """Write how spring k lies at the present poses; return its extension [m] and inverse mass.

    The inverse is of the effective mass, times the mass of a mass.
    """
    masses, springs, table = group.masses, group.springs, group.spring_table
    a, b = group.spring_ends[k, 0], group.spring_ends[k, 1]
    ax, ay = anchor(masses, a, table[k, 0], table[k, 1])
    bx, by = anchor(masses, b, table[k, 2], table[k, 3])
    dx = (load(masses, b, X) + bx) - (load(masses, a, X) + ax)
    dy = (load(masses, b, Y) + by) - (load(masses, a, Y) + ay)
    length = math.sqrt(dx * dx + dy * dy)
    per_length = select(length == 0.0, 0.0, 1.0 / length)
    nx, ny = dx * per_length, dy * per_length
    arm_a, arm_b = (ax * ny - ay * nx) * group.per_rho, (bx * ny - by * nx) * group.per_rho
    store(springs, k, _NX, nx)
    store(springs, k, _NY, ny)
    store(springs, k, _ARM_A, arm_a)
    store(springs, k, _ARM_B, arm_b)
    change = load(group.actuation, k // N_SPRINGS, 0)
    short, rest, long = table[k, 4], table[k, 5], table[k, 6]
    rest = rest + select(change > 0.0, short - rest, long - rest) * abs(change)
    return length - rest, 2.0 + arm_a * arm_a + arm_b * arm_b


@inlined_part
def _push(group, k, j):
    """Let an impulse act along spring k."""
    masses, springs = group.masses, group.springs
    a, b = group.spring_ends[k, 0], group.spring_ends[k, 1]
    nx, ny = load(springs, k, _NX), load(springs, k, _NY)
    arm_a, arm_b = load(springs, k, _ARM_A), load(springs, k, _ARM_B)
    vx, vy, spin = get_velocity(masses, a)
    set_velocity(masses, a, (vx - nx * j, vy - ny * j, spin - arm_a * j))
    vx, vy, spin = get_velocity(masses, b)
    set_velocity(masses, b, (vx + nx * j, vy + ny * j, spin + arm_b * j))


@inlined_part
def pull(springs, k, a, b):
    """Let spring k act once between masses of velocities a and b; return both."""
    nx, ny = load(springs, k, _NX), load(springs, k, _NY)
    arm_a, arm_b = load(springs, k, _ARM_A), load(springs, k, _ARM_B)
    target = load(springs, k, _TARGET)
    # The order of these sums keeps the chain from one spring to the next short.
    excess = (target - (arm_b * b[2] - arm_a * a[2])) - (nx * (b[0] - a[0]) + ny * (b[1] - a[1]))
    j = excess * load(springs, k, _PULL)
    jx, jy = nx * j, ny * j
    store(springs, k, _TARGET, (target - excess) + excess * load(springs, k, _SHARE))
    return (a[0] - jx, a[1] - jy, a[2] - arm_a * j), (b[0] + jx, b[1] + jy, b[2] + arm_b * j)
