"""The two physics, sets of rules by which the body moves and is sensed, selected by name."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Physics:
    """How springs are integrated, when sensors are read, and how much overlap contacts allow.

    Attributes:
        implicit_springs: True if springs are soft constraints, integrated implicitly as in dyn4j.
            False if their force is an explicit impulse and their damping an exponential, as in
            Chipmunk.
        current_poses: True if a step ends by moving the masses, so that sensors read the poses at
            the end of the step. False if a step begins by moving them, so that sensors read poses
            one step late.
        slop: depth [m] of the overlap that contacts do not correct.
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
"""Physics by name: that of the reference, 2D-VSR-Sim on dyn4j, and this project's first one."""

DEFAULT_PHYSICS, UNNAMED_PHYSICS = 'reference', 'first'
"""The physics of new simulations, and of files without a name of one, which are older."""
