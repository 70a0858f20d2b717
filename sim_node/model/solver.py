"""By which physics a control step is solved, and how finely."""

from dataclasses import dataclass

from sim_node.errors import check_keys
from sim_node.model.constants import check_declared, choice, constant
from sim_node.model.physics import DEFAULT_PHYSICS, PHYSICS, UNNAMED_PHYSICS, Physics

SELF_COLLISION = (False, True, 'reference')
"""Which masses of one robot collide: none; all that no weld joins, by the material's friction and
restitution squared; or, as in 2D-VSR-Sim, all that no constraint joins, with friction 10 and
restitution 0.1."""


@dataclass(frozen=True)
class Solver:
    """How finely the engine solves a control step; defaults measured, see docs/physics.md.

    Raises:
        InvalidInput: a value is off.
    """

    substeps: int = constant(1, 1, 100, 'physics steps per control step')
    iterations: int = constant(10, 1, 1000, 'sweeps of the impulse solver per physics step')
    self_collision: bool | str = choice(
        False, SELF_COLLISION, 'whether masses of one robot collide with each other'
    )
    physics: str = choice(
        DEFAULT_PHYSICS, PHYSICS, 'by which rules the body moves and is sensed'
    )

    def __post_init__(self) -> None:
        check_declared(self, 'solver.')

    @property
    def rules(self) -> Physics:
        """Return the physics that the name stands for."""
        return PHYSICS[self.physics]

    @classmethod
    def from_dict(cls, values: dict) -> 'Solver':
        """Return the solver that a file describes: `values` in place of defaults.

        A file that names no physics is older than the names, and has `UNNAMED_PHYSICS`.

        Raises:
            InvalidInput: a key or value is off.
        """
        check_keys('solver', values, list(cls.__dataclass_fields__))
        return cls(**{'physics': UNNAMED_PHYSICS, **values})
