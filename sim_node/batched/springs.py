"""Springs, explicit (Chipmunk's cpDampedSpring) or implicit (a soft constraint, as in dyn4j).

The force of an explicit spring is applied once before a step, and its damping in the sweeps of the
impulse solver. An implicit spring applies both in the sweeps, by the arithmetic that
`sim_node.munk2d.soft_spring` derives.
"""

import math

from sim_node.batched.state import COS, N_SPRINGS, SIN, VX, X, Y
from sim_node.numerics.elementary_functions import expm1
from sim_node.numerics.jit import compiled_part, inlined_part
from sim_node.numerics.lanes import load, select, store

_NX, _NY, _ARM_A, _ARM_B, _SHARE, _IMPULSE_FACTOR, _TARGET, _ELASTIC = range(8)
"""Fields of `Group.springs`: unit vector from anchor a to anchor b; lever arms about the centres of
the masses, divided by the radius of gyration; share of the excess relative velocity that a sweep
removes, and the impulse per unit of excess; target of the relative velocity; impulse that an
explicit spring of the same extension would apply in this step (implicit springs only)."""

_ANCHOR_AX, _ANCHOR_AY, _ANCHOR_BX, _ANCHOR_BY = range(4)
_REST_CONTRACTED, _REST, _REST_EXPANDED, _STIFFNESS, _DAMPING, _SOFTNESS = range(4, 10)
"""Columns of `Group.spring_table`: anchors [m]; rest lengths of a contracted, a resting and an
expanded voxel [m]; stiffness and damping times the physics step over the mass of a mass; softness
of an implicit spring, gamma times that mass."""


@inlined_part
def anchor(masses, i, ax, ay):
    """Return the offset [m] of an anchor from the centre of mass i, in world axes.

    Args:
        ax, ay: the anchor [m] in the axes of the mass.
    """
    c, s = load(masses, i, COS), load(masses, i, SIN)
    return c * ax - s * ay, s * ax + c * ay


@inlined_part
def get_velocity(masses, i, first=VX):
    """Return (v_x, v_y, angular velocity times the radius of gyration) of mass i, all [m/s].

    Args:
        first: first of the three fields: `VX`, or `BIAS_X` for the bias velocity, which corrects
            overlaps.
    """
    return load(masses, i, first), load(masses, i, first + 1), load(masses, i, first + 2)


@inlined_part
def set_velocity(masses, i, velocity, first=VX):
    """Write the velocity of mass i in the form in which `get_velocity` returns it."""
    store(masses, i, first, velocity[0])
    store(masses, i, first + 1, velocity[1])
    store(masses, i, first + 2, velocity[2])


@compiled_part
def prepare_explicit_springs(group):
    """Prepare all explicit springs at the present poses, and apply their forces for one step."""
    springs, table = group.springs, group.spring_table
    for k in range(springs.shape[0]):
        extension, inv_mass = _update_geometry(group, k)
        share = -expm1(max(-table[k, _DAMPING] * inv_mass, -700.0))
        store(springs, k, _SHARE, share)
        store(springs, k, _IMPULSE_FACTOR, share / inv_mass)
        store(springs, k, _TARGET, 0.0)
        _apply_impulse(group, k, -extension * table[k, _STIFFNESS])


@compiled_part
def prepare_implicit_springs(group):
    """Prepare all implicit springs at the present poses, and warm-start them."""
    springs, table = group.springs, group.spring_table
    for k in range(springs.shape[0]):
        softness = table[k, _SOFTNESS]
        impulse = load(springs, k, _TARGET) * (-1.0 / softness) - load(springs, k, _ELASTIC)
        extension, inv_mass = _update_geometry(group, k)
        elastic, inv_sum = extension * table[k, _STIFFNESS], 1.0 / (inv_mass + softness)
        store(springs, k, _SHARE, inv_mass * inv_sum)
        store(springs, k, _IMPULSE_FACTOR, inv_sum)
        store(springs, k, _TARGET, -softness * (elastic + impulse))
        store(springs, k, _ELASTIC, elastic)
        _apply_impulse(group, k, impulse)


@inlined_part
def _update_geometry(group, k):
    """Write axis and lever arms of spring k at the present poses.

    Returns:
        Its extension [m], and the mass of a mass over the spring's effective mass.
    """
    masses, springs, table = group.masses, group.springs, group.spring_table
    a, b = group.spring_ends[k, 0], group.spring_ends[k, 1]
    ax, ay = anchor(masses, a, table[k, _ANCHOR_AX], table[k, _ANCHOR_AY])
    bx, by = anchor(masses, b, table[k, _ANCHOR_BX], table[k, _ANCHOR_BY])
    dx = (load(masses, b, X) + bx) - (load(masses, a, X) + ax)
    dy = (load(masses, b, Y) + by) - (load(masses, a, Y) + ay)
    length = math.sqrt(dx * dx + dy * dy)
    inv_length = select(length == 0.0, 0.0, 1.0 / length)
    nx, ny = dx * inv_length, dy * inv_length
    arm_a = (ax * ny - ay * nx) * group.inv_gyration_radius
    arm_b = (bx * ny - by * nx) * group.inv_gyration_radius
    store(springs, k, _NX, nx)
    store(springs, k, _NY, ny)
    store(springs, k, _ARM_A, arm_a)
    store(springs, k, _ARM_B, arm_b)
    actuation = load(group.actuation, k // N_SPRINGS, 0)
    short, rest, long = table[k, _REST_CONTRACTED], table[k, _REST], table[k, _REST_EXPANDED]
    rest = rest + select(actuation > 0.0, short - rest, long - rest) * abs(actuation)
    return length - rest, 2.0 + arm_a * arm_a + arm_b * arm_b


@inlined_part
def _apply_impulse(group, k, j):
    """Apply impulse j along spring k to both of its masses."""
    masses, springs = group.masses, group.springs
    a, b = group.spring_ends[k, 0], group.spring_ends[k, 1]
    nx, ny = load(springs, k, _NX), load(springs, k, _NY)
    arm_a, arm_b = load(springs, k, _ARM_A), load(springs, k, _ARM_B)
    vx, vy, spin = get_velocity(masses, a)
    set_velocity(masses, a, (vx - nx * j, vy - ny * j, spin - arm_a * j))
    vx, vy, spin = get_velocity(masses, b)
    set_velocity(masses, b, (vx + nx * j, vy + ny * j, spin + arm_b * j))


@inlined_part
def solve_spring(springs, k, a, b):
    """Apply spring k once to masses of velocities a and b; return both velocities."""
    nx, ny = load(springs, k, _NX), load(springs, k, _NY)
    arm_a, arm_b = load(springs, k, _ARM_A), load(springs, k, _ARM_B)
    target = load(springs, k, _TARGET)
    # The order of these sums keeps the dependency chain from one spring to the next short.
    excess = (target - (arm_b * b[2] - arm_a * a[2])) - (nx * (b[0] - a[0]) + ny * (b[1] - a[1]))
    j = excess * load(springs, k, _IMPULSE_FACTOR)
    jx, jy = nx * j, ny * j
    store(springs, k, _TARGET, (target - excess) + excess * load(springs, k, _SHARE))
    return (a[0] - jx, a[1] - jy, a[2] - arm_a * j), (b[0] + jx, b[1] + jy, b[2] + arm_b * j)
