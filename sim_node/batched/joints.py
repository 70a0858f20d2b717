"""Contraction limits and welds (Chipmunk's cpSlideJoint, cpPivotJoint).

Both are warm-started with the impulse of the last step, and correct a gap by a bias velocity.
"""

import math

from sim_node.batched.springs import anchor, get_velocity, set_velocity
from sim_node.batched.state import N_LIMITS, X, Y
from sim_node.numerics.jit import compiled_part, inlined_part
from sim_node.numerics.lanes import any_lane, load, select, store

_NX, _NY, _BIAS, _IMPULSE = range(4)
"""Fields of `Group.limits`: unit vector from b to a, 0 where the limit is not reached; bias
velocity that corrects the violation; impulse. The effective mass is 1/2, since a limit joins
centres."""

_AX, _AY, _BX, _BY, _K_XX, _K_XY, _K_YY, _BIAS_X, _BIAS_Y, _JX, _JY = range(11)
"""Fields of `Group.welds`: lever arms (anchors divided by the radius of gyration); inverse of the
2 x 2 matrix from an impulse to the change of relative velocity; bias velocity that corrects the
gap; accumulated impulse."""


@compiled_part
def prepare_joints(group):
    """Prepare all limits and welds at the present poses."""
    masses, limits, welds = group.masses, group.limits, group.welds
    n_limits = limits.shape[0]
    for k in range(n_limits):
        voxel = k // N_LIMITS
        a, b = group.limit_ends[k, 0], group.limit_ends[k, 1]
        if k % N_LIMITS == 0:
            group.active[n_limits + voxel] = False
        dx = load(masses, b, X) - load(masses, a, X)
        dy = load(masses, b, Y) - load(masses, a, Y)
        squared = dx * dx + dy * dy
        reached = squared < group.limits_table[k] * group.limits_table[k]
        group.active[k] = any_lane(reached)
        if not group.active[k]:
            store(limits, k, _IMPULSE, 0.0)
            continue
        group.active[n_limits + voxel] = True
        length = math.sqrt(squared)
        inv_length = select(reached & (length > 0.0), 1.0 / length, 0.0)
        overlap = select(reached, group.limits_table[k] - length, 0.0)
        store(limits, k, _NX, -dx * inv_length)
        store(limits, k, _NY, -dy * inv_length)
        store(limits, k, _BIAS, -group.bias * overlap)
        store(limits, k, _IMPULSE, select(reached, load(limits, k, _IMPULSE), 0.0))
    for k in range(welds.shape[0]):
        a, b = group.weld_ends[k, 0], group.weld_ends[k, 1]
        ax, ay = anchor(masses, a, group.weld_anchors[k, 0], group.weld_anchors[k, 1])
        bx, by = anchor(masses, b, group.weld_anchors[k, 2], group.weld_anchors[k, 3])
        gap_x = (load(masses, b, X) + bx) - (load(masses, a, X) + ax)
        gap_y = (load(masses, b, Y) + by) - (load(masses, a, Y) + ay)
        store(welds, k, _BIAS_X, -group.bias * gap_x)
        store(welds, k, _BIAS_Y, -group.bias * gap_y)
        ax, ay = ax * group.inv_gyration_radius, ay * group.inv_gyration_radius
        bx, by = bx * group.inv_gyration_radius, by * group.inv_gyration_radius
        xx, yy = 2.0 + ay * ay + by * by, 2.0 + ax * ax + bx * bx
        xy = -(ax * ay + bx * by)
        inv_det = 1.0 / (xx * yy - xy * xy)
        store(welds, k, _AX, ax)
        store(welds, k, _AY, ay)
        store(welds, k, _BX, bx)
        store(welds, k, _BY, by)
        store(welds, k, _K_XX, yy * inv_det)
        store(welds, k, _K_XY, -xy * inv_det)
        store(welds, k, _K_YY, xx * inv_det)


@inlined_part
def _apply_limit_impulse(limits, k, a, b, j):
    jx, jy = load(limits, k, _NX) * j, load(limits, k, _NY) * j
    return (a[0] - jx, a[1] - jy, a[2]), (b[0] + jx, b[1] + jy, b[2])


@inlined_part
def solve_limit(limits, k, a, b):
    """Apply limit k once to masses of velocities a and b; return both velocities.

    A limit only pushes the masses apart: its impulse is never positive.
    """
    v = load(limits, k, _NX) * (b[0] - a[0]) + load(limits, k, _NY) * (b[1] - a[1])
    old = load(limits, k, _IMPULSE)
    new = min(old + (load(limits, k, _BIAS) - v) * 0.5, 0.0)
    store(limits, k, _IMPULSE, new)
    return _apply_limit_impulse(limits, k, a, b, new - old)


@inlined_part
def _apply_weld_impulse(welds, k, a, b, jx, jy):
    ax, ay, bx, by = (
        load(welds, k, _AX), load(welds, k, _AY), load(welds, k, _BX), load(welds, k, _BY)
    )
    return (
        (a[0] - jx, a[1] - jy, a[2] - (ax * jy - ay * jx)),
        (b[0] + jx, b[1] + jy, b[2] + (bx * jy - by * jx)),
    )


@inlined_part
def solve_weld(welds, k, a, b):
    """Apply weld k once to masses of velocities a and b; return both velocities."""
    vx = (b[0] - load(welds, k, _BY) * b[2]) - (a[0] - load(welds, k, _AY) * a[2])
    vy = (b[1] + load(welds, k, _BX) * b[2]) - (a[1] + load(welds, k, _AX) * a[2])
    ux, uy = load(welds, k, _BIAS_X) - vx, load(welds, k, _BIAS_Y) - vy
    jx = load(welds, k, _K_XX) * ux + load(welds, k, _K_XY) * uy
    jy = load(welds, k, _K_XY) * ux + load(welds, k, _K_YY) * uy
    store(welds, k, _JX, load(welds, k, _JX) + jx)
    store(welds, k, _JY, load(welds, k, _JY) + jy)
    return _apply_weld_impulse(welds, k, a, b, jx, jy)


@compiled_part
def warm_start_joints(group):
    """Apply the impulses of the last step of all limits and welds."""
    masses, limits, welds = group.masses, group.limits, group.welds
    for k in range(limits.shape[0]):
        if group.active[k]:
            i, j = group.limit_ends[k, 0], group.limit_ends[k, 1]
            impulse = load(limits, k, _IMPULSE)
            a, b = get_velocity(masses, i), get_velocity(masses, j)
            a, b = _apply_limit_impulse(limits, k, a, b, impulse)
            set_velocity(masses, i, a)
            set_velocity(masses, j, b)
    for k in range(welds.shape[0]):
        i, j = group.weld_ends[k, 0], group.weld_ends[k, 1]
        jx, jy = load(welds, k, _JX), load(welds, k, _JY)
        a, b = get_velocity(masses, i), get_velocity(masses, j)
        a, b = _apply_weld_impulse(welds, k, a, b, jx, jy)
        set_velocity(masses, i, a)
        set_velocity(masses, j, b)
