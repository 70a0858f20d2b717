"""Ground profiles by name, such as flat, hilly-h-w-seed, steppy-h-w-seed, uphill-a, stairs-h-w."""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sim_node.errors import InvalidInput, near_miss

LENGTH = 2000.0
"""Extent of the ground in x [m]."""

WALL_WIDTH, WALL_HEIGHT = 10.0, 100.0
"""Width and height [m] of the walls, the rises of the ground at both ends."""

FLAT_LEVEL = 5.0
"""Height [m] of flat ground, and of the lower end of a slope."""

DEPTH = 50.0
"""Depth [m] of the solid ground below its lowest point."""

_STEP_RISE_WIDTH = 0.5
_NUMBER = r'(\d+(?:\.\d+)?)'
_SEED = r'(0|[1-9]\d*)'  # one name for each
_MAX_HEIGHT, _MAX_RUN, _MAX_ANGLE, _MAX_GROWTH = 100.0, 1000.0, 60.0, 1.0


@dataclass(frozen=True, eq=False)
class Terrain:
    """A piecewise-linear ground profile.

    Attributes:
        name: its name, as for `parse_terrain`.
        x, y: (n_points,) coordinates [m] of the profile's corners, x increasing.
    """

    name: str
    x: np.ndarray
    y: np.ndarray

    def __repr__(self) -> str:
        return f'Terrain({self.name!r})'

    @property
    def start(self) -> float:
        """Return the x [m] of the right end of the left wall; robots start 1 m right of it."""
        return float(self.x[1])

    @property
    def feet_of_walls(self) -> np.ndarray:
        """Return the x [m] between which the ground is free of walls, (2,), see `meetings`."""
        return self.x[[1, -2]]

    @property
    def polygons(self) -> np.ndarray:
        """Return the solid ground as one polygon per piece of the profile, (n_pieces, 4, 2) [m].

        Corners are counter-clockwise from the lower left one, as in Munk2D's convex hulls.
        """
        top = np.column_stack([self.x, self.y])
        base = np.column_stack([self.x, np.full_like(self.x, self.y.min() - DEPTH)])
        return np.stack([base[:-1], base[1:], top[1:], top[:-1]], axis=1)

    def height_at(self, x: float) -> float:
        """Return the ground's height [m] at `x` [m]."""
        return float(np.interp(x, self.x, self.y))

    def highest(self, left: float, right: float) -> float:
        """Return the greatest height [m] of the ground from x = `left` to x = `right` [m]."""
        corners = self.y[(self.x > left) & (self.x < right)].tolist()
        return max(self.height_at(left), self.height_at(right), *corners)


def parse_terrain(name: str) -> Terrain:
    """Return the terrain of that name.

    Args:
        name: 'flat', 'hilly-<h>-<w>-<seed>', 'steppy-<h>-<w>-<seed>' (h: standard
            deviation of the height changes [m], w: mean run [m]), 'uphill-<angle>',
            'downhill-<angle>' ([degrees]), or 'stairs-<h>-<w>' (the i-th rise is i h high [m], and
            before it are w [m] of flat ground).

    Raises:
        InvalidInput: the name is none of these, or a number is out of range.
    """
    if not isinstance(name, str):
        raise InvalidInput('terrain', name, 'a string such as flat or hilly-1-10-0')
    kind = name.partition('-')[0]
    if kind not in _KINDS:
        expected = f'one of {TERRAIN_FORM}'
        raise InvalidInput('terrain', name, expected + near_miss(kind, tuple(_KINDS)))
    form, pattern, make = _KINDS[kind]
    match = re.fullmatch(pattern, name, re.ASCII)
    if match is None or len(name) > 60:
        raise InvalidInput('terrain', name, form)
    x, y = make(name, *match.groups())
    return Terrain(name, np.array(x), np.array(y))


def _between_walls(x: list[float], y: list[float]) -> tuple[list[float], list[float]]:
    """Return a profile with a wall added at either end."""
    return (
        [x[0] - WALL_WIDTH, *x, x[-1] + WALL_WIDTH],
        [y[0] + WALL_HEIGHT - FLAT_LEVEL, *y, y[-1] + WALL_HEIGHT - FLAT_LEVEL],
    )


def _flat(name: str) -> tuple[list[float], list[float]]:
    return _between_walls([WALL_WIDTH, LENGTH - WALL_WIDTH], [FLAT_LEVEL, FLAT_LEVEL])


def _slope(name: str, angle: str) -> tuple[list[float], list[float]]:
    degrees = float(angle)
    if degrees > _MAX_ANGLE:
        raise InvalidInput('terrain', name, f'an angle of at most {_MAX_ANGLE:g} degrees')
    rise = (LENGTH - 2 * WALL_WIDTH) * math.tan(math.radians(degrees))
    left, right = (0.0, rise) if name.startswith('uphill') else (rise, 0.0)
    return _between_walls(
        [WALL_WIDTH, LENGTH - WALL_WIDTH], [FLAT_LEVEL + left, FLAT_LEVEL + right]
    )


def _irregular(name: str, h: str, w: str, seed: str) -> tuple[list[float], list[float]]:
    """Return hills or steps: runs of max(1, N(1, 0.25) w) in x, height changes of N(0, 1) h."""
    spread, run = float(h), float(w)
    if spread > _MAX_HEIGHT or not 1.0 <= run <= _MAX_RUN:
        expected = f'h of at most {_MAX_HEIGHT:g} and w from 1 to {_MAX_RUN:g}'
        raise InvalidInput('terrain', name, expected)
    rng = np.random.default_rng(int(seed))
    x, y = [WALL_WIDTH], [FLAT_LEVEL]
    while x[-1] < LENGTH - WALL_WIDTH:
        x.append(x[-1] + max(1.0, (1.0 + 0.25 * rng.standard_normal()) * run))
        rise = spread * rng.standard_normal()
        if name.startswith('steppy'):
            y.append(y[-1])
            x.append(x[-1] + _STEP_RISE_WIDTH)
        y.append(y[-1] + rise)
    return _between_walls(x, y)


def _stairs(name: str, h: str, w: str) -> tuple[list[float], list[float]]:
    """Return a staircase that becomes steeper: runs of w in x, and after the i-th a rise of i h."""
    growth, run = float(h), float(w)
    if growth > _MAX_GROWTH or not 1.0 <= run <= _MAX_RUN:
        expected = f'h of at most {_MAX_GROWTH:g} and w from 1 to {_MAX_RUN:g}'
        raise InvalidInput('terrain', name, expected)
    x, y, n_rises = [WALL_WIDTH], [FLAT_LEVEL], 0
    while x[-1] < LENGTH - WALL_WIDTH:
        n_rises += 1
        x += [x[-1] + run, x[-1] + run + _STEP_RISE_WIDTH]
        y += [y[-1], y[-1] + n_rises * growth]
    return _between_walls(x, y)


_KINDS: dict[str, tuple[str, str, Callable]] = {
    'flat': ('flat', 'flat', _flat),
    'hilly': ('hilly-<h>-<w>-<seed>', rf'hilly-{_NUMBER}-{_NUMBER}-{_SEED}', _irregular),
    'steppy': ('steppy-<h>-<w>-<seed>', rf'steppy-{_NUMBER}-{_NUMBER}-{_SEED}', _irregular),
    'uphill': ('uphill-<degrees>', rf'uphill-{_NUMBER}', _slope),
    'downhill': ('downhill-<degrees>', rf'downhill-{_NUMBER}', _slope),
    'stairs': ('stairs-<h>-<w>', rf'stairs-{_NUMBER}-{_NUMBER}', _stairs),
}

DEFAULT_TERRAIN = 'flat'

TERRAIN_FORM = ', '.join(form for form, *_ in _KINDS.values())
"""The forms of terrain names, for help texts and documents."""

_IRREGULAR = (
    *(f'hilly-{size}' for size in ('0.5-10', '0.5-20', '1-10', '1-20', '2-20', '2-30')),
    *(f'steppy-{size}' for size in ('0.25-10', '0.25-20', '0.5-10', '0.5-20', '1-20', '1-30')),
)
_SLOPES = ('downhill-10', 'downhill-20', 'uphill-10', 'uphill-20')

UNSEEN_KINDS = (*_IRREGULAR, *_SLOPES)
"""The 16 kinds of terrain of the re-assessment (paper, section 4.1; the values are this project's).

The names of hilly and steppy kinds lack a seed; the names of slopes are names of terrains."""

MOST_TERRAIN_SEEDS = 1000
"""Largest number of seeds per irregular kind in `unseen_terrains`."""


def unseen_terrains(n_seeds: int = 1) -> dict[str, tuple[str, ...]]:
    """Return the names of the unseen terrains of each of `UNSEEN_KINDS`.

    The i-th irregular kind, i from 1 to 12, has the seeds i, i + 12, i + 24, ...: no two terrains
    share a seed, and a larger number of seeds only adds terrains. A slope is one terrain.

    Args:
        n_seeds: number of seeds per irregular kind, from 1 to `MOST_TERRAIN_SEEDS`.

    Raises:
        InvalidInput: the number is out of range.
    """
    is_number = isinstance(n_seeds, int) and not isinstance(n_seeds, bool)
    if not is_number or not 1 <= n_seeds <= MOST_TERRAIN_SEEDS:
        raise InvalidInput('terrain_seeds', n_seeds, f'an integer from 1 to {MOST_TERRAIN_SEEDS}')
    irregular = {
        kind: tuple(f'{kind}-{i + len(_IRREGULAR) * j}' for j in range(n_seeds))
        for i, kind in enumerate(_IRREGULAR, 1)
    }
    return {**irregular, **{kind: (kind,) for kind in _SLOPES}}


DEFAULT_TERRAIN_SET, FIRST_TERRAIN_SET = 'seeds-1-12', 'seed-0'
"""Names of the default terrain set of an assessment, and of the set of the first results."""

TERRAIN_SETS = {
    DEFAULT_TERRAIN_SET: tuple(name for names in unseen_terrains().values() for name in names),
    FIRST_TERRAIN_SET: (*(f'{kind}-0' for kind in _IRREGULAR), *_SLOPES),
}
"""Sets of unseen terrains by name, each in the order of `UNSEEN_KINDS`.

In the set of the first results all terrains scale the same sequence of random numbers."""

UNSEEN_TERRAINS = TERRAIN_SETS[DEFAULT_TERRAIN_SET]
"""The 16 terrains of the default set."""
