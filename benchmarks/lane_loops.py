"""Compares the vector type of `sim_node.numerics.lanes` with plain loops over lanes.

    python -m benchmarks.lane_loops [--quick] [--json FILE]

The task is a sweep over all springs of a group, W = 16, the inner loop of a step. It is written
with values of lanes and as a loop over lanes, which LLVM vectorises, without and with the promise
that arrays do not overlap. All versions give the same bits. Rounds alternate; the results are
medians of CPU time.
"""

import statistics

import numba
import numpy as np

from benchmarks.batched import new_robots, seconds
from benchmarks.command import run_part
from sim_node.batched.springs import get_velocity, set_velocity, solve_spring
from sim_node.batched.state import SPIN, VX, VY
from sim_node.numerics.jit import compiled, compiled_kernel
from sim_node.simulation import Simulation


@compiled
def by_type(group, springs, masses, n):
    """Apply every spring `n` times, with values of lanes."""
    for _ in range(n):
        for k in range(springs.shape[0]):
            a, b = group.spring_ends[k, 0], group.spring_ends[k, 1]
            va, vb = solve_spring(
                springs, k, get_velocity(masses, a), get_velocity(masses, b)
            )
            set_velocity(masses, a, va)
            set_velocity(masses, b, vb)


def _loop(springs, a, b):
    """Do the same as `solve_spring`, lane by lane, for a spring (8, W) between masses (11, W)."""
    for i in range(16):
        nx, ny, arm_a, arm_b = springs[0, i], springs[1, i], springs[2, i], springs[3, i]
        target, share = springs[6, i], springs[4, i]
        spin = arm_b * b[SPIN, i] - arm_a * a[SPIN, i]
        excess = (target - spin) - (nx * (b[VX, i] - a[VX, i]) + ny * (b[VY, i] - a[VY, i]))
        j = excess * springs[5, i]
        springs[6, i] = (target - excess) + excess * share
        a[VX, i] -= nx * j
        a[VY, i] -= ny * j
        a[SPIN, i] -= arm_a * j
        b[VX, i] += nx * j
        b[VY, i] += ny * j
        b[SPIN, i] += arm_b * j


def _sweeps(loop):
    @numba.njit(error_model='numpy', _nrt=False)
    def by_loops(group, springs, masses, n):
        for _ in range(n):
            for k in range(springs.shape[0]):
                a, b = group.spring_ends[k, 0], group.spring_ends[k, 1]
                loop(springs[k], masses[a], masses[b])

    return by_loops


def measure(quick: bool) -> dict:
    """Return the CPU time per spring and robot [ns] of each version."""
    robots = new_robots(Simulation('biped'), 16)
    start = np.random.default_rng(0)
    group, n = robots.group, 20 if quick else 200
    springs, masses = group.springs['lane'], group.mass_lanes
    springs[:] = start.uniform(0.0, 0.2, springs.shape)
    masses[:] = start.uniform(-1.0, 1.0, masses.shape)
    first = springs.copy(), masses.copy()
    plain = numba.njit(_loop, error_model='numpy', _nrt=False)
    ways = {
        'vector type': (by_type, group.springs, group.masses),
        'loops': (_sweeps(plain), springs, masses),
        'loops, no overlap': (_sweeps(compiled_kernel(_loop)), springs, masses),
    }
    ends = set[bytes]()
    times: dict[str, list[float]] = {name: [] for name in ways}
    for _ in range(5 if quick else 25):
        for name, (run, *arrays) in ways.items():
            springs[:], masses[:] = first
            run(group, *arrays, 1)
            ends.add(springs.tobytes() + masses.tobytes())
            times[name].append(seconds(run, group, *arrays, n) / (n * springs.shape[0] * 16) * 1e9)
    return {
        'ns': {name: statistics.median(t[1:]) for name, t in times.items()},
        'same_bits': len(ends) == 1,
    }


def table(figures: dict) -> str:
    """Return the measurements as text."""
    ns = figures['ns']
    lines = [f'{t / ns["vector type"]:6.2f} x   {t:6.2f} ns   {name}' for name, t in ns.items()]
    return '\n'.join([*lines, f'the same bits: {figures["same_bits"]}'])


if __name__ == '__main__':
    run_part(__doc__, measure, table)
