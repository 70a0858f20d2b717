"""Morphologies: the voxels on a grid, their names and their neighbours."""

import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sim_node.errors import InvalidInput, near_miss

DIRECTIONS = ('above', 'left', 'below', 'right')
"""The order of directions in all arrays with a direction axis (paper: up, left, down, right)."""

OPPOSITE = (2, 3, 0, 1)
"""`OPPOSITE[d]` is the direction from a neighbour in direction `d` back to the voxel."""

OFFSETS = ((0, 1), (-1, 0), (0, -1), (1, 0))
"""(dx, dy) of the neighbour in each direction; x grows to the right, y upwards."""

_MAX_SIDE = 64

_GENERATORS: dict[str, Callable[[int, int, int, int], bool]] = {
    'box': lambda x, y, w, h: True,
    'worm': lambda x, y, w, h: True,
    'biped': lambda x, y, w, h: not (y < h // 2 and w // 4 <= x < w * 3 // 4),
    'tripod': lambda x, y, w, h: not (y < h // 2 and x not in (0, w // 2, w - 1)),
    'comb': lambda x, y, w, h: not (y < h // 2 and x % 2 == 1),
    't': lambda x, y, w, h: y == h - 1 or (w - 1) // 2 <= x <= w // 2,
    'ball': lambda x, y, w, h: (
        round(np.hypot(x - (w - 1) / 2, y - (w - 1) / 2) + 1e-9) <= w // 2
    ),
}
_DEFAULT_SIZE = {'biped': '4x3', 'comb': '7x2', 'worm': '5x1', 'tripod': '5x3'}
SHAPES = tuple(_GENERATORS)
DEFAULT_SHAPE = 'biped'


@dataclass(frozen=True)
class Morphology:
    """An arrangement of voxels on a grid.

    Attributes:
        name: the text that it was parsed from ('biped', 'comb-7x2', or the grid string).
        squares: (x, y) of every voxel, x from the left, y from the bottom, row by row from the
            bottom. A voxel's position in this tuple is its index in all arrays.
        missing: (x, y) of voxels that were left out, in the same order. They have no index, and the
            others keep the coordinates, and so the names, that they have in the complete body.
    """

    name: str
    squares: tuple[tuple[int, int], ...]
    missing: tuple[tuple[int, int], ...] = ()

    def __repr__(self) -> str:
        n = f'{self.n_voxels} voxel{"" if self.n_voxels == 1 else "s"}'
        return f'Morphology({self.name!r}, {n}, {self.grid_string!r})'

    @property
    def n_voxels(self) -> int:
        """Return the number of voxels."""
        return len(self.squares)

    @property
    def width(self) -> int:
        """Return the number of columns of the grid."""
        return max(x for x, _ in self.complete) + 1

    @property
    def height(self) -> int:
        """Return the number of rows of the grid."""
        return max(y for _, y in self.complete) + 1

    @cached_property
    def complete(self) -> tuple[tuple[int, int], ...]:
        """Return (x, y) of the voxels and the missing ones, row by row from the bottom."""
        return _row_by_row((*self.squares, *self.missing))

    @cached_property
    def voxel_names(self) -> tuple[str, ...]:
        """Return `voxel_<x>_<y>` of every voxel, in index order."""
        return _names(self.squares)

    @property
    def missing_names(self) -> tuple[str, ...]:
        """Return `voxel_<x>_<y>` of every missing voxel."""
        return _names(self.missing)

    @property
    def label(self) -> str:
        """Return the name with the missing voxels: 'biped without voxel_0_0, voxel_3_0'."""
        return f'{self.name} without {", ".join(self.missing_names)}' if self.missing else self.name

    @cached_property
    def neighbors(self) -> np.ndarray:
        """Return the (n_voxels, 4) int64 array of neighbours' indices, -1 where there is none.

        Columns follow `DIRECTIONS`.
        """
        index = {square: i for i, square in enumerate(self.squares)}
        table = [[index.get((x + dx, y + dy), -1) for dx, dy in OFFSETS] for x, y in self.squares]
        return np.array(table, dtype=np.int64)

    @cached_property
    def grid_string(self) -> str:
        """Return the rows from top to bottom, in the paper's notation, such as '1111-1111-1001'.

        A missing voxel is an x: '1111-1111-x001'.
        """
        marks = {**dict.fromkeys(self.squares, '1'), **dict.fromkeys(self.missing, 'x')}
        rows = range(self.height - 1, -1, -1)
        return '-'.join(
            ''.join(marks.get((x, y), '0') for x in range(self.width)) for y in rows
        )

    def index_of(self, voxel_name: str) -> int:
        """Return the index of a voxel by its name; raise InvalidInput if there is no such voxel."""
        try:
            return self.voxel_names.index(voxel_name)
        except ValueError:
            expected = f'a voxel of {self.name} ({self.grid_string}), voxel_<x>_<y>'
            expected += near_miss(voxel_name, self.voxel_names)
            raise InvalidInput('voxel', voxel_name, expected) from None

    def same_shape(self, other: 'Morphology') -> bool:
        """Return whether both have the same voxels; names are not compared."""
        return self.squares == other.squares

    def without(self, names: str | Iterable[str]) -> 'Morphology':
        """Return the body without some voxels, which become `missing`.

        Args:
            names: names of voxels, or a text with commas between them; none or '' for all voxels.

        Raises:
            InvalidInput: there is no such voxel, or the others are not one connected piece.
        """
        if isinstance(names, str):
            names = names.split(',') if names else ()
        lost = {self.squares[self.index_of(name)] for name in names}
        left = [square for square in self.squares if square not in lost]
        if not left or _reachable(left) != set(left):
            expected = f'voxels of {self.name} without which the others are one connected piece'
            raise InvalidInput('without', ','.join(_names(_row_by_row(lost))), expected)
        return replace(self, squares=tuple(left), missing=_row_by_row((*self.missing, *lost)))


def parse_morphology(text: str) -> Morphology:
    """Return the morphology described by `text`.

    Args:
        text: a shape ('biped', 'comb-9x3', 'ball-5') or a grid string, rows from top to bottom
            ('1111-1111-1001'), with an x for a missing voxel ('1111-1111-x001').

    Raises:
        InvalidInput: the shape is unknown, the size is not allowed, or the voxels are not one
                connected piece.
    """
    if not isinstance(text, str):
        raise InvalidInput('morphology', text, 'a string such as biped or 1111-1111-1001')
    if re.fullmatch(r'[01x]+(-[01x]+)*', text):
        return Morphology(text, *_squares_of_grid(text))
    kind, dash, size = text.partition('-')
    if kind not in _GENERATORS:
        expected = (
            f'one of {", ".join(SHAPES)} (with a size, e.g. comb-7x2)'
            ' or a grid such as 1111-1111-1001' + near_miss(kind, SHAPES)
        )
        raise InvalidInput('morphology', text, expected)
    w, h = _parse_size(text, kind, size if dash else _DEFAULT_SIZE.get(kind, ''))
    is_voxel = _GENERATORS[kind]
    rows = (''.join('1' if is_voxel(x, y, w, h) else '0' for x in range(w)) for y in range(h))
    return Morphology(text, *_squares_of_grid('-'.join(reversed(list(rows))), text))


def _parse_size(text: str, kind: str, size: str) -> tuple[int, int]:
    pattern, expected = r'(\d{1,3})x(\d{1,3})', f'{kind}-<width>x<height>, e.g. {kind}-5x3'
    if kind == 'ball':
        pattern, expected = r'(\d{1,3})', 'ball-<width>, e.g. ball-5'
    match = re.fullmatch(pattern, size, re.ASCII)
    if match is None:
        raise InvalidInput('morphology', text, expected)
    w, h = int(match[1]), int(match[match.lastindex or 1])
    if not (1 <= w <= _MAX_SIDE and 1 <= h <= _MAX_SIDE):
        raise InvalidInput('morphology', text, f'a width and height from 1 to {_MAX_SIDE}')
    return w, h


def _squares_of_grid(grid: str, text: str | None = None) -> tuple[tuple[tuple[int, int], ...], ...]:
    """Return the squares of the voxels and of the missing ones."""
    text = text or grid
    rows = grid.split('-')
    if len({len(row) for row in rows}) != 1:
        raise InvalidInput('morphology', text, 'rows of equal length')
    if len(rows) > _MAX_SIDE or len(rows[0]) > _MAX_SIDE:
        raise InvalidInput('morphology', text, f'at most {_MAX_SIDE} rows and columns')
    marked = [
        (x, y, c) for y, row in enumerate(reversed(rows)) for x, c in enumerate(row) if c != '0'
    ]
    squares = [(x, y) for x, y, c in marked if c == '1']
    if not squares:
        raise InvalidInput('morphology', text, 'at least one voxel (1)')
    if _reachable(squares) != set(squares):
        raise InvalidInput('morphology', text, 'voxels that form one connected piece')
    x0, y0 = min(x for x, _, _ in marked), min(y for _, y, _ in marked)
    return tuple(
        tuple((x - x0, y - y0) for x, y, c in marked if c == kind) for kind in ('1', 'x')
    )


def _row_by_row(squares: Iterable[tuple[int, int]]) -> tuple[tuple[int, int], ...]:
    return tuple(sorted(squares, key=lambda square: square[::-1]))


def _names(squares: Iterable[tuple[int, int]]) -> tuple[str, ...]:
    return tuple(f'voxel_{x}_{y}' for x, y in squares)


def _reachable(squares: list[tuple[int, int]]) -> set[tuple[int, int]]:
    """Return the squares that are connected to the first one."""
    todo, seen, occupied = [squares[0]], {squares[0]}, set(squares)
    while todo:
        x, y = todo.pop()
        for dx, dy in OFFSETS:
            cell = (x + dx, y + dy)
            if cell in occupied and cell not in seen:
                seen.add(cell)
                todo.append(cell)
    return seen
