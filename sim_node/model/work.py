"""The work of the actuators: the change of the springs' elastic energy at fixed masses.

The actuator of a voxel changes the rest lengths r of its springs at the start of a control step, in
no time: the masses, and with them the lengths l of the springs, are where the last step left them.
So it does the work

    W = sum of k / 2 ((l - r_new)^2 - (l - r_old)^2)

over the springs of the voxel, with their stiffness k. It is negative where springs that pull or
push give energy back to the actuator. docs/physics.md has an example.
"""

import math
from typing import NamedTuple

import numpy as np

from sim_node.model.body import springs_of
from sim_node.model.material import Material
from sim_node.model.morphology import Morphology
from sim_node.numerics.elementary_functions import sine_cosine
from sim_node.numerics.jit import compiled, compiled_inline


class WorkMeter(NamedTuple):
    """The state of the measurement for W robots of one shape, from one control step to the next."""

    ends: np.ndarray  # (n_springs, 2) masses
    anchors: np.ndarray  # (n_springs, 4) [m], see `Constraints`
    stiffness: np.ndarray  # (n_springs,) [N/m]
    rest: np.ndarray  # (n_springs, 3) rest lengths [m] contracted, at rest, expanded
    axes: np.ndarray  # (n_masses, 2, W) cosine and sine of the masses' angles
    lengths: np.ndarray  # (n_springs, W) [m] at the end of the last step
    actuation: np.ndarray  # (n_voxels, W) of the last step
    work: np.ndarray  # (n_voxels, W) of the last step [J]


def make_work_meter(morphology: Morphology, material: Material, width: int = 1) -> WorkMeter:
    """Return the meter of `width` robots; `measure_work` has to be called at their start."""
    springs, n = springs_of(morphology, material), morphology.n_voxels
    return WorkMeter(
        springs.ends, springs.anchors, springs.stiffness, springs.rest_lengths,
        axes=np.zeros((4 * n, 2, width)), lengths=np.zeros((len(springs.ends), width)),
        actuation=np.zeros((n, width)), work=np.zeros((n, width)),
    )


def nothing_measured(meter: WorkMeter) -> WorkMeter:
    """Return a meter of the same type without springs, which costs nothing."""
    return WorkMeter(*(array[:0] for array in meter))


@compiled
def measure_work(meter, masses, actuation):
    """Write the work of the control step that has ended to `meter.work`; 0 at the start.

    Args:
        meter: `WorkMeter` of the robots.
        masses: (n_masses, 3 or more, W) x, y [m], angle [rad] at the end of the step.
        actuation: (n_voxels, W) during the step, in [-1, 1]; 0 at the start.
    """
    n_voxels, width = meter.work.shape
    for mass in range(meter.axes.shape[0]):
        for lane in range(width):
            s, c = sine_cosine(masses[mass, 2, lane])
            meter.axes[mass, 0, lane], meter.axes[mass, 1, lane] = c, s
    for voxel in range(n_voxels):
        n_springs = meter.stiffness.shape[0] // n_voxels
        for lane in range(width):
            old, new = meter.actuation[voxel, lane], actuation[voxel, lane]
            work = 0.0
            for k in range(voxel * n_springs, (voxel + 1) * n_springs):
                length, rest = meter.lengths[k, lane], meter.rest[k]
                before = length - _rest_length(rest, old)
                after = length - _rest_length(rest, new)
                work += 0.5 * meter.stiffness[k] * (after * after - before * before)
                meter.lengths[k, lane] = _length(meter, masses, k, lane)
            meter.actuation[voxel, lane], meter.work[voxel, lane] = new, work


@compiled_inline
def _rest_length(rest, actuation):
    """Return the rest length [m] of a spring from the three of a row of `WorkMeter.rest`."""
    extreme = rest[0] if actuation > 0.0 else rest[2]
    return rest[1] + (extreme - rest[1]) * abs(actuation)


@compiled_inline
def _length(meter, masses, k, lane):
    """Return the distance [m] between the anchors of spring k."""
    ax, ay = _anchor(meter, masses, k, 0, lane)
    bx, by = _anchor(meter, masses, k, 1, lane)
    x, y = bx - ax, by - ay
    return math.sqrt(x * x + y * y)


@compiled_inline
def _anchor(meter, masses, k, end, lane):
    """Return the position (x, y) [m] of one of the two anchors of spring k."""
    mass, x, y = meter.ends[k, end], meter.anchors[k, 2 * end], meter.anchors[k, 2 * end + 1]
    c, s = meter.axes[mass, 0, lane], meter.axes[mass, 1, lane]
    return masses[mass, 0, lane] + (c * x - s * y), masses[mass, 1, lane] + (s * x + c * y)
