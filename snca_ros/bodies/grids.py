"""Grids of voxels as genomes: their feet, random grids, and mutations."""

from collections.abc import Callable, Collection
from dataclasses import dataclass

import numpy as np

from sim_node.model.morphology import OFFSETS, Morphology, parse_morphology

Squares = frozenset[tuple[int, int]]
"""(x, y) of voxels; the least x and y may be any."""

_MORE = 0.5  # probability of each further mutation of the same body


@dataclass(frozen=True)
class Frame:
    """The bodies of a search: one connected piece of voxels within a rectangle.

    Attributes:
        width, height: largest number of columns and of rows.
        voxels: largest number of voxels.
    """

    width: int
    height: int
    voxels: int

    def fits(self, squares: Collection[tuple[int, int]]) -> bool:
        """Return whether voxels are not too many and not too far apart."""
        (left, right), (bottom, top) = ((min(v), max(v)) for v in zip(*squares, strict=True))
        within = right - left < self.width and top - bottom < self.height
        return within and len(squares) <= self.voxels

    def is_possible(self, size: int, feet: int) -> bool:
        """Return whether there is a body of that size with that number of feet.

        Several feet need a gap between each pair of them, and a row above that connects them.
        """
        least, gaps = (1, 0) if feet == 1 else (3 * feet - 1, feet - 1)
        wide = feet == 1 or (self.width >= 2 * feet - 1 and self.height > 1)
        return wide and least <= size <= min(self.voxels, self.width * self.height - gaps)

    @property
    def most_feet(self) -> int:
        """Return the largest possible number of feet."""
        return max(feet for _, feet in self.cells)

    @property
    def cells(self) -> list[tuple[int, int]]:
        """Return all possible pairs of size and number of feet."""
        return [
            (size, feet) for size in range(1, self.voxels + 1)
            for feet in range(1, (self.width + 1) // 2 + 1) if self.is_possible(size, feet)
        ]


def count_feet(body: Morphology) -> int:
    """Return the number of feet: runs of adjacent voxels in the lowest row.

    These voxels are the first that touch flat ground when the robot is put down.
    """
    bottom = {x for x, y in body.squares if y == 0}
    return sum(x - 1 not in bottom for x in bottom)


def body_of(squares: Collection[tuple[int, int]]) -> Morphology:
    """Return the body with these voxels, named by its grid; InvalidInput if not connected."""
    left, bottom = (min(v) for v in zip(*squares, strict=True))
    right, top = (max(v) for v in zip(*squares, strict=True))
    occupied = set(squares)
    return parse_morphology('-'.join(
        ''.join('1' if (x, y) in occupied else '0' for x in range(left, right + 1))
        for y in range(top, bottom - 1, -1)
    ))


def random_body(frame: Frame, rng: np.random.Generator) -> Morphology:
    """Return a body that has grown from one voxel to a random size, as far as the frame allows."""
    squares: Squares = frozenset({(0, 0)})
    for _ in range(int(rng.integers(frame.voxels))):
        squares = _with_one_more(squares, frame, rng)
    return body_of(squares)


def mutated(body: Morphology, frame: Frame, rng: np.random.Generator) -> Morphology:
    """Return a body after one or several random mutations, connected and within the frame.

    A mutation adds, removes or moves a voxel, or mirrors the body, with equal probabilities.
    Another one follows with probability 1/2. A mutation that is impossible has no effect.
    """
    squares: Squares = frozenset(body.squares)
    while True:
        squares = MUTATIONS[int(rng.integers(len(MUTATIONS)))](squares, frame, rng)
        if rng.random() >= _MORE:
            return body_of(squares)


def _with_one_more(squares: Squares, frame: Frame, rng: np.random.Generator) -> Squares:
    beside = {(x + dx, y + dy) for x, y in squares for dx, dy in OFFSETS} - squares
    options = [square for square in sorted(beside) if frame.fits(squares | {square})]
    return squares | {_one_of(options, rng)} if options else squares


def _with_one_less(squares: Squares, frame: Frame, rng: np.random.Generator) -> Squares:
    options = [square for square in sorted(squares) if _is_connected(squares - {square})]
    return squares - {_one_of(options, rng)} if options else squares


def _with_one_moved(squares: Squares, frame: Frame, rng: np.random.Generator) -> Squares:
    return _with_one_more(_with_one_less(squares, frame, rng), frame, rng)


def _mirrored(squares: Squares, frame: Frame, rng: np.random.Generator) -> Squares:
    return frozenset((-x, y) for x, y in squares)


MUTATIONS: tuple[Callable[[Squares, Frame, np.random.Generator], Squares], ...] = (
    _with_one_more, _with_one_less, _with_one_moved, _mirrored,
)
"""Functions that mutate the voxels of a body."""


def _one_of(options: list[tuple[int, int]], rng: np.random.Generator) -> tuple[int, int]:
    return options[int(rng.integers(len(options)))]


def _is_connected(squares: Squares) -> bool:
    """Return whether voxels are one piece; False if there is none."""
    if not squares:
        return False
    todo, left = [next(iter(squares))], set(squares)
    left.remove(todo[0])
    while todo:
        x, y = todo.pop()
        for dx, dy in OFFSETS:
            if (square := (x + dx, y + dy)) in left:
                left.remove(square)
                todo.append(square)
    return not left
