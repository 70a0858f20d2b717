"""The two sets of rules by which the body moves and is sensed, each selected by one name."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Physics:
    """How springs are integrated, when sensors are read, and how deep contacts may rest.

    Attributes:
        implicit_springs: springs are soft constraints, integrated implicitly as dyn4j does; else
            their force is an explicit impulse and their damping an exponential, as in Chipmunk.
        current_poses: a step ends with the motion of the masses, so that sensors read the poses
            that the velocities of this step have led to; else those of the step before.
        slop: depth [m] of an overlap that contacts leave alone.
    """

    implicit_springs: bool
    current_poses: bool
    slop: float


PHYSICS = {
    'reference': Physics(implicit_springs=True, current_poses=True, slop=0.005),
    'first': Physics(
        implicit_springs=False, current_poses=False, slop=float(np.float32(0.1))  # Munk2D's
    ),
}
"""Rules by name: those of the reference, 2D-VSR-Sim on dyn4j, and the first ones of this project.
"""

DEFAULT_PHYSICS, UNNAMED_PHYSICS = 'reference', 'first'
"""What a new simulation has; and what a file has that names no physics, being older than names."""
