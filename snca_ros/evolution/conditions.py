"""The conditions of an episode: the body, the ground, the start and the faults of the robot."""

from dataclasses import dataclass

from snca_ros.faults import NO_FAULTS, Faults


@dataclass(frozen=True)
class Conditions:
    """The conditions of one episode; a controller and they determine it.

    Attributes:
        shape: morphology, a name or a grid.
        terrain: name of the terrain.
        push: 0, or the seed of a pushed start, see `Simulation`.
        faults: of the robot.
    """

    shape: str
    terrain: str
    push: int = 0
    faults: Faults = NO_FAULTS
