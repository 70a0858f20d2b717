"""The physical constants of a voxel and of its world, each with its unit and its range."""

import math
from dataclasses import dataclass, fields

from sim_node.errors import InvalidInput, check_keys
from sim_node.model.constants import check_declared, constant


@dataclass(frozen=True)
class Material:
    """Physical constants of a voxel, its contacts and its world (2D-VSR-Sim's defaults).

    Raises:
        InvalidInput: a value is not finite or out of its range.
    """

    side: float = constant(3.0, 1.0, 100.0, 'side of a voxel at rest', 'm')
    mass_ratio: float = constant(0.40, 0.1, 0.44, 'side of a corner mass per side of the voxel')
    density: float = constant(0.25, 1e-3, 1e3, 'density of a corner mass', 'kg/m^2')
    frequency: float = constant(8.0, 0.1, 30.0, 'frequency of a spring', 'Hz')
    damping_ratio: float = constant(0.3, 0.0, 2.0, 'damping ratio of a spring')
    area_range: float = constant(0.225, 0.0, 0.35, 'largest relative change of area by actuation')
    friction: float = constant(math.sqrt(10 * 0.2), 0.0, 10.0, 'friction mass against ground')
    restitution: float = constant(0.1, 0.0, 1.0, 'restitution mass against ground')
    damping: float = constant(0.1, 0.0, 10.0, 'linear and angular damping of a mass', '1/s')
    gravity: float = constant(9.8, 0.0, 100.0, 'gravity, downwards', 'm/s^2')

    def __post_init__(self) -> None:
        check_declared(self, 'material.')
        if self.rest_lengths(self.actuated_side(-self.area_range))[0] <= 0.0:
            expected = 'a mass_ratio or area_range that leaves room between contracted masses'
            raise InvalidInput('material.area_range', self.area_range, expected)

    @classmethod
    def from_dict(cls, values: dict) -> 'Material':
        """Return the material with `values` in place of defaults.

        Raises:
            InvalidInput: a key is unknown, or a value is out of its range.
        """
        check_keys('material', values, [f.name for f in fields(cls)])
        return cls(**values)

    @property
    def mass_side(self) -> float:
        """Return the side [m] of a corner mass."""
        return self.side * self.mass_ratio

    @property
    def mass(self) -> float:
        """Return the mass [kg] of a corner mass."""
        return self.density * self.mass_side**2

    @property
    def moment(self) -> float:
        """Return the moment of inertia [kg m^2] of a corner mass, a square."""
        return self.mass * self.mass_side**2 / 6.0

    def rest_lengths(self, side: float) -> tuple[float, float, float]:
        """Return the rest lengths [m] of (parallel, side cross, central cross) springs.

        Args:
            side: side [m] of a voxel whose springs are at rest.
        """
        parallel = side - 2.0 * self.mass_side
        cross = math.sqrt(self.mass_side**2 + parallel**2)
        return parallel, cross, (side - self.mass_side) * math.sqrt(2.0)

    def actuated_side(self, area_change: float) -> float:
        """Return the side [m] of a voxel of (1 + `area_change`) times its area at rest."""
        return math.sqrt(self.side**2 * (1.0 + area_change))
