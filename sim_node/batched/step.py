"""One physics step of a group, in Munk2D's order of operations (Chipmunk's cpSpaceStep).

The algorithm is that of Chipmunk2D (MIT licence; Scott Lembcke, Howling Moon Software) and of
pymunk's fork Munk2D (Victor Blomqvist): semi-implicit Euler, and sequential impulses with warm
starting after Catto, "Iterative dynamics with temporal coherence" (2005).
"""

from sim_node.batched.contacts import (
    find_contacts,
    solve_contacts,
    solve_overlaps,
    warm_start_contacts,
)
from sim_node.batched.joints import prepare_joints, solve_limit, solve_weld, warm_start_joints
from sim_node.batched.springs import (
    get_velocity,
    prepare_explicit_springs,
    prepare_implicit_springs,
    set_velocity,
    solve_spring,
)
from sim_node.batched.state import ANGLE, BIAS_X, COS, N_LIMITS, N_SPRINGS, SIN, X, Y
from sim_node.numerics.elementary_functions import sine_cosine
from sim_node.numerics.jit import compiled_part
from sim_node.numerics.lanes import load, store


@compiled_part
def physics_step(group):
    """Advance all robots of the group by `group.dt`.

    The reference's order is velocities, poses, contacts at these poses. Chipmunk runs through the
    same cycle, but its step begins with the poses.
    """
    group.step_count[0] += 1.0
    if not group.current_poses:
        move_masses(group.masses, group.dt, group.inv_gyration_radius)
        find_contacts(group)
    if group.implicit_springs:
        apply_gravity(group.masses, group.damping, group.fall)
        prepare_implicit_springs(group)
    else:
        prepare_explicit_springs(group)
        apply_gravity(group.masses, group.damping, group.fall)
    prepare_joints(group)
    warm_start_contacts(group)
    warm_start_joints(group)
    solve_overlaps(group)
    for _ in range(group.iterations):
        solve_contacts(group)
        sweep(group)
    if group.current_poses:
        move_masses(group.masses, group.dt, group.inv_gyration_radius)
        find_contacts(group)


@compiled_part
def move_masses(masses, dt, inv_gyration_radius):
    """Move all masses by their velocities and bias velocities, and reset the bias velocities."""
    for i in range(masses.shape[0]):
        vx, vy, spin = get_velocity(masses, i)
        bias_x, bias_y, bias_spin = get_velocity(masses, i, BIAS_X)
        angle = load(masses, i, ANGLE) + (spin + bias_spin) * (dt * inv_gyration_radius)
        s, c = sine_cosine(angle)
        store(masses, i, X, load(masses, i, X) + (vx + bias_x) * dt)
        store(masses, i, Y, load(masses, i, Y) + (vy + bias_y) * dt)
        store(masses, i, ANGLE, angle)
        store(masses, i, COS, c)
        store(masses, i, SIN, s)
        set_velocity(masses, i, (0.0, 0.0, 0.0), BIAS_X)


@compiled_part
def apply_gravity(masses, damping, speed_gain):
    """Damp all velocities and apply gravity.

    Args:
        damping: factor on the velocities.
        speed_gain: gravity times the physics step [m/s].
    """
    for i in range(masses.shape[0]):
        vx, vy, spin = get_velocity(masses, i)
        vx, vy = vx * damping + 0.0, vy * damping - speed_gain
        set_velocity(masses, i, (vx, vy, spin * damping + 0.0))


@compiled_part
def sweep(group):
    """Solve every spring, limit and weld once, in the order in which they enter Munk2D's space.

    There the welds of a voxel follow its springs and limits. They join it to voxels before it, so
    the result is the same if all welds follow the springs and limits of all voxels.
    """
    masses, springs, limits, welds = group.masses, group.springs, group.limits, group.welds
    for voxel in range(limits.shape[0] // N_LIMITS):
        i, k, m = 4 * voxel, N_SPRINGS * voxel, N_LIMITS * voxel
        nw, ne = get_velocity(masses, i), get_velocity(masses, i + 1)
        se, sw = get_velocity(masses, i + 2), get_velocity(masses, i + 3)
        for j in range(k, k + 4):
            nw, ne = solve_spring(springs, j, nw, ne)
        for j in range(k + 4, k + 8):
            ne, se = solve_spring(springs, j, ne, se)
        for j in range(k + 8, k + 12):
            se, sw = solve_spring(springs, j, se, sw)
        for j in range(k + 12, k + 16):
            sw, nw = solve_spring(springs, j, sw, nw)
        nw, se = solve_spring(springs, k + 16, nw, se)
        ne, sw = solve_spring(springs, k + 17, ne, sw)
        if group.active[limits.shape[0] + voxel]:
            if group.active[m]:
                nw, ne = solve_limit(limits, m, nw, ne)
            if group.active[m + 1]:
                ne, se = solve_limit(limits, m + 1, ne, se)
            if group.active[m + 2]:
                se, sw = solve_limit(limits, m + 2, se, sw)
            if group.active[m + 3]:
                sw, nw = solve_limit(limits, m + 3, sw, nw)
        set_velocity(masses, i, nw)
        set_velocity(masses, i + 1, ne)
        set_velocity(masses, i + 2, se)
        set_velocity(masses, i + 3, sw)
    for k in range(0, welds.shape[0], 2):
        i, j = group.weld_ends[k, 0], group.weld_ends[k, 1]
        a, b = solve_weld(welds, k, get_velocity(masses, i), get_velocity(masses, j))
        a, b = solve_weld(welds, k + 1, a, b)
        set_velocity(masses, i, a)
        set_velocity(masses, j, b)
