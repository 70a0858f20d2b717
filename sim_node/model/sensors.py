"""The sensors of a voxel: what each measures, and how measures are mapped to [0, 1].

A sensor is a named tuple of constants with a compiled method `measure`, which works for one robot
and for robots in lanes; `sim_node.model.sensing` reads any selection of them. To add one, see
docs/python.md.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

from sim_node.errors import InvalidInput, check_name
from sim_node.numerics.elementary_functions import sine_cosine, tanh
from sim_node.numerics.jit import compiled, compiled_inline, compiled_kernel
from sim_node.registry import Registry, check_class_name

MAX_AREA_RATIO = 100.0
"""Largest area of a voxel, relative to rest; beyond it the physics counts as diverged."""


class Voxel(NamedTuple):
    """The state of a voxel at a control step, as sensors read it: numbers or lanes."""

    x: tuple  # [m] of the masses NW, NE, SE, SW
    y: tuple  # [m]
    v_x: tuple  # [m/s]
    v_y: tuple  # [m/s]
    area_ratio: Any  # area over area at rest
    touching: Any  # 1.0 if one of the masses touches the ground, else 0.0


@compiled_inline
def soft_normalise(value, low, high):
    """Map a number or lanes softly from [low, high] to [0, 1] (2D-VSR-Sim).

    The result is tanh((2 u - 1) 2) / 2 + 1/2 with u = (value - low) / (high - low).
    """
    u = (value - low) / (high - low)
    return tanh((2.0 * u - 1.0) * 2.0) / 2.0 + 0.5


@compiled_inline
def own_axes(voxel):
    """Return cosine and sine of a voxel's rotation, numbers or lanes.

    The voxel's x axis points along the mean direction of its top and its bottom side.
    """
    x, y = voxel.x, voxel.y
    top_x, top_y = x[1] - x[0], y[1] - y[0]
    low_x, low_y = x[2] - x[3], y[2] - y[3]
    top, low = math.sqrt(top_x * top_x + top_y * top_y), math.sqrt(low_x * low_x + low_y * low_y)
    axis_x, axis_y = top_x / top + low_x / low, top_y / top + low_y / low
    length = math.sqrt(axis_x * axis_x + axis_y * axis_y)
    return axis_x / length, axis_y / length


@compiled_inline
def own_velocity(voxel):
    """Return the mean velocity (along, across) [m/s] of a voxel's masses in its `own_axes`."""
    c, s = own_axes(voxel)
    v_x, v_y = voxel.v_x, voxel.v_y
    mean_x = (v_x[0] + v_x[1] + v_x[2] + v_x[3]) / 4.0
    mean_y = (v_y[0] + v_y[1] + v_y[2] + v_y[3]) / 4.0
    return c * mean_x + s * mean_y, c * mean_y - s * mean_x


class Area(NamedTuple):
    """Area over area at rest (paper, section 2.1)."""

    window: int = 1  # control steps over which measures are averaged
    low: float = 0.5  # the mean from `low` to `high` is mapped softly to [0, 1]
    high: float = 1.5

    @staticmethod
    @compiled_inline
    def measure(sensor, voxel):
        """Return the area ratio."""
        return voxel.area_ratio


class Touch(NamedTuple):
    """Share of the last control steps at which the voxel touched the ground (as 2D-VSR-Sim)."""

    window: int = 15  # 0.25 s

    @staticmethod
    @compiled_inline
    def measure(sensor, voxel):
        """Return 1.0 if the voxel touches the ground, else 0.0."""
        return voxel.touching


class VelocityAlong(NamedTuple):
    """Velocity along the voxel's own x axis (paper, section 2.1; averaged as in 2D-VSR-Sim)."""

    window: int = 30  # 0.5 s
    low: float = -8.0  # [m/s]
    high: float = 8.0  # [m/s]

    @staticmethod
    @compiled_inline
    def measure(sensor, voxel):
        """Return the velocity [m/s]."""
        along, _ = own_velocity(voxel)
        return along


class VelocityAcross(NamedTuple):
    """Velocity along the voxel's own y axis (paper, section 2.1; averaged as in 2D-VSR-Sim)."""

    window: int = 30  # 0.5 s
    low: float = -8.0  # [m/s]
    high: float = 8.0  # [m/s]

    @staticmethod
    @compiled_inline
    def measure(sensor, voxel):
        """Return the velocity [m/s]."""
        _, across = own_velocity(voxel)
        return across


class SensorRegistry(Registry[Any]):
    """Sensors by name."""

    def register(self, name: str, thing: Any) -> None:
        """Add a sensor: a named tuple of numbers with a `window` and a compiled `measure`.

        Raises:
            InvalidInput: the object is no such tuple, the name is taken, or another sensor's class
                has the same name (numba distinguishes compiled code by it).
        """
        if not isinstance(name, str) or not name.isidentifier():
            raise InvalidInput(self.kind, name, 'a name of letters, digits and _')
        kind, field = type(thing), f'{self.kind} {name}'
        fields = thing._asdict() if hasattr(kind, '_fields') else {}
        numbers = all(type(value) in (int, float) for value in fields.values())
        if not fields or not numbers or not hasattr(getattr(kind, 'measure', None), 'py_func'):
            expected = 'a named tuple of int and float with a compiled method `measure`'
            raise InvalidInput(field, thing, expected)
        if type(fields.get('window')) is not int or not 1 <= fields['window'] <= MAX_WINDOW:
            raise InvalidInput(
                f'{field}.window', fields.get('window'), f'an integer from 1 to {MAX_WINDOW}'
            )
        given = [fields[end] for end in ('low', 'high') if end in fields]
        if len(given) == 1 or sorted({*given}) != given:
            raise InvalidInput(field, thing, '`low` and a higher `high`, or neither')
        check_class_name(field, kind, map(type, self.values()))
        super().register(name, thing)


MAX_WINDOW = 3600
"""Longest window of a sensor [control steps]: one minute."""

SENSORS = SensorRegistry('sensors', {
    'area': Area(),
    'touch': Touch(),
    'velocity_x': VelocityAlong(),
    'velocity_y': VelocityAcross(),
})
"""Sensors by name."""

DEFAULT_SENSORS = ('area', 'touch', 'velocity_x', 'velocity_y')
"""The paper's sensors (section 2.1), the default, in the order of the readings."""


def check_sensors(names: Sequence[str]) -> tuple[str, ...]:
    """Return names of sensors as a tuple.

    Raises:
        InvalidInput: `names` is not a list of names in `SENSORS`, each once.
    """
    is_list = isinstance(names, (tuple, list)) and len(names) > 0
    if not is_list or len({*map(str, names)}) != len(names):
        raise InvalidInput('sensors', names, 'a list of names, each once')
    for name in names:
        check_name('sensors', name, SENSORS)
    return tuple(names)


@compiled_inline
def twice_area(x, y):
    """Return twice the area of a voxel.

    Args:
        x, y: coordinates [m] of the corners NW, NE, SE, SW; 4-tuples of numbers or lanes.
    """
    total = x[1] * y[0] - x[0] * y[1]
    total = total + (x[2] * y[1] - x[1] * y[2])
    total = total + (x[3] * y[2] - x[2] * y[3])
    return total + (x[0] * y[3] - x[3] * y[0])


@compiled
def polygon_area(corners):
    """Return the area [m^2] of a voxel from its (4, 2) corners [m] NW, NE, SE, SW."""
    return twice_area(_column(corners, 0), _column(corners, 1)) / 2.0


@compiled_inline
def _column(rows, j):
    return rows[0, j], rows[1, j], rows[2, j], rows[3, j]


@compiled_kernel
def outer_corners(masses, half_side, corners):
    """Write the (4 n_voxels, 2) outer corners [m] of voxels.

    Args:
        masses: (4 n_voxels, 5) x, y, angle, v_x, v_y of the masses NW, NE, SE, SW of each voxel.
        half_side: half the side of a mass [m].
    """
    for i in range(masses.shape[0]):
        corner = i & 3
        sx = -half_side if corner == 0 or corner == 3 else half_side
        sy = half_side if corner < 2 else -half_side
        s, c = sine_cosine(masses[i, 2])
        corners[i, 0] = masses[i, 0] + c * sx - s * sy
        corners[i, 1] = masses[i, 1] + s * sx + c * sy


@compiled
def center_of_mass(masses):
    """Return a robot's centre of mass (x, y) [m] from its (n_masses, 5) rows of equal masses."""
    x = y = 0.0
    for i in range(masses.shape[0]):
        x += masses[i, 0]
        y += masses[i, 1]
    return x / masses.shape[0], y / masses.shape[0]
