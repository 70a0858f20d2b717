"""Damped springs (Chipmunk's cpDampedSpring): the force once before a step, damping in sweeps."""

import math

from sim_node.batched.group import COS, N_SPRINGS, SIN, VX, X, Y
from sim_node.compiled import compiled_part, inlined_part
from sim_node.elementary import expm1
from sim_node.lanes import load, select, store

_NX, _NY, _ARM_A, _ARM_B, _DRAG, _PULL, _TARGET = range(7)
"""Fields: unit vector from a to b, lever arms about the masses' centres, share of the relative
velocity that damping takes in a step and the impulse that does it, relative velocity to be left."""


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
    """Prepare every spring at the present poses and apply its force for the step."""
    masses, springs, table = group.masses, group.springs, group.spring_table
    for k in range(springs.shape[0]):
        a, b = group.spring_ends[k, 0], group.spring_ends[k, 1]
        ax, ay = anchor(masses, a, table[k, 0], table[k, 1])
        bx, by = anchor(masses, b, table[k, 2], table[k, 3])
        dx = (load(masses, b, X) + bx) - (load(masses, a, X) + ax)
        dy = (load(masses, b, Y) + by) - (load(masses, a, Y) + ay)
        length = math.sqrt(dx * dx + dy * dy)
        per_length = select(length == 0.0, 0.0, 1.0 / length)
        nx, ny = dx * per_length, dy * per_length
        arm_a, arm_b = (ax * ny - ay * nx) * group.per_rho, (bx * ny - by * nx) * group.per_rho
        stiff = 2.0 + arm_a * arm_a + arm_b * arm_b
        store(springs, k, _NX, nx)
        store(springs, k, _NY, ny)
        store(springs, k, _ARM_A, arm_a)
        store(springs, k, _ARM_B, arm_b)
        drag = -expm1(max(-table[k, 8] * stiff, -700.0))
        store(springs, k, _DRAG, drag)
        store(springs, k, _PULL, drag / stiff)
        store(springs, k, _TARGET, 0.0)

        change = load(group.actuation, k // N_SPRINGS, 0)
        short, rest, long = table[k, 4], table[k, 5], table[k, 6]
        rest = rest + select(change > 0.0, short - rest, long - rest) * abs(change)
        j = (rest - length) * table[k, 7]
        vx, vy, spin = get_velocity(masses, a)
        set_velocity(masses, a, (vx - nx * j, vy - ny * j, spin - arm_a * j))
        vx, vy, spin = get_velocity(masses, b)
        set_velocity(masses, b, (vx + nx * j, vy + ny * j, spin + arm_b * j))


@inlined_part
def damp(springs, k, a, b):
    """Let the damping of spring k act between masses of velocities a and b; return both."""
    nx, ny = load(springs, k, _NX), load(springs, k, _NY)
    arm_a, arm_b = load(springs, k, _ARM_A), load(springs, k, _ARM_B)
    target = load(springs, k, _TARGET)
    # The order of these sums keeps the chain from one spring to the next short.
    excess = (target - (arm_b * b[2] - arm_a * a[2])) - (nx * (b[0] - a[0]) + ny * (b[1] - a[1]))
    j = excess * load(springs, k, _PULL)
    jx, jy = nx * j, ny * j
    store(springs, k, _TARGET, (target - excess) + excess * load(springs, k, _DRAG))
    return (a[0] - jx, a[1] - jy, a[2] - arm_a * j), (b[0] + jx, b[1] + jy, b[2] + arm_b * j)
