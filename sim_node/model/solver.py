"""The solver's settings: physics, sub-steps, iterations and self-collision."""

from dataclasses import dataclass

from sim_node.errors import check_keys
from sim_node.model.constants import check_declared, choice, constant
from sim_node.model.physics import DEFAULT_PHYSICS, PHYSICS, UNNAMED_PHYSICS, Physics

SELF_COLLISION = (False, True, 'reference')
"""Which masses of one robot collide with each other: none; all that no weld joins, with the square
of the material's friction and restitution; or, as in 2D-VSR-Sim, all that no constraint joins, with
friction 10 and restitution 0.1."""


@dataclass(frozen=True)
class Solver:
    """How an engine solves a control step; docs/physics.md measures the defaults.

    Raises:
        InvalidInput: a value is out of its range or choices.
    """

    substeps: int = constant(1, 1, 100, 'physics steps per control step')
    iterations: int = constant(10, 1, 1000, 'sweeps of the impulse solver per physics step')
    self_collision: bool | str = choice(
        False, SELF_COLLISION, 'whether masses of one robot collide with each other'
    )
    physics: str = choice(
        DEFAULT_PHYSICS, PHYSICS, 'rules by which the body moves and is sensed'
    )

    def __post_init__(self) -> None:
        check_declared(self, 'solver.')

    @property
    def rules(self) -> Physics:
        """Return the physics of that name."""
        return PHYSICS[self.physics]

    @classmethod
    def from_dict(cls, values: dict) -> 'Solver':
        """Return the solver with `values`, read from a file, in place of defaults.

        Without a `physics` the file is older than the names of physics: it has `UNNAMED_PHYSICS`.

        Raises:
            InvalidInput: a key is unknown, or a value is out of its range or choices.
        """
        check_keys('solver', values, list(cls.__dataclass_fields__))
        return cls(**{'physics': UNNAMED_PHYSICS, **values})
