"""By which physics a control step is solved, and how finely."""

from dataclasses import dataclass

from sim_node.errors import InvalidInput, check_keys, check_name
from sim_node.model.physics import DEFAULT_PHYSICS, PHYSICS, UNNAMED_PHYSICS, Physics

SELF_COLLISION = (False, True, 'reference')
"""Which masses of one robot collide: none; all that no weld joins, by the material's friction and
restitution squared; or, as in 2D-VSR-Sim, all that no constraint joins, with friction 10 and
restitution 0.1."""


@dataclass(frozen=True)
class Solver:
    """How finely the engine solves a control step; defaults measured, see docs/physics.md.

    Attributes:
        substeps: physics steps per control step.
        iterations: sweeps of the impulse solver per physics step.
        self_collision: whether masses of one robot collide with each other: one of
            `SELF_COLLISION`.
        physics: one of `sim_node.model.physics.PHYSICS`.
    """

    substeps: int = 1
    iterations: int = 10
    self_collision: bool | str = False
    physics: str = DEFAULT_PHYSICS

    def __post_init__(self) -> None:
        for name, high in (('substeps', 100), ('iterations', 1000)):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= high:
                raise InvalidInput(f'solver.{name}', value, f'an integer from 1 to {high}')
        value = self.self_collision
        if not isinstance(value, (bool, str)) or value not in SELF_COLLISION:
            expected = f'true, false or {SELF_COLLISION[-1]}'
            raise InvalidInput('solver.self_collision', value, expected)
        check_name('solver.physics', self.physics, PHYSICS)

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
