"""What contact with the ground's polygons needs to know beforehand."""

import numpy as np


def most_at_once(ground: np.ndarray, length: float) -> int:
    """Return how many polygons an interval of `length` [m] in x can meet at most.

    Args:
        ground: (n, 4, 2) corners [m], counter-clockwise from the lower left, x increasing.
    """
    starts, ends = ground[:, 0, 0], ground[:, 1, 0]
    return int((np.searchsorted(starts, ends + length, side='right') - np.arange(len(ends))).max())


def query_order(ground: np.ndarray) -> np.ndarray:
    """Return each polygon's rank in the order in which Munk2D's broad phase meets the ground.

    A mass that touches two polygons is pushed by one after the other, and the order shows in the
    result. Munk2D keeps bounding boxes in a binary tree: a new one descends to where the areas
    grow least, and becomes the first child beside the leaf that it meets (cpBBTree.c).
    """
    low, high = ground.min(axis=1), ground.max(axis=1)
    boxes = [_Box(*a, *b) for a, b in zip(low.tolist(), high.tolist(), strict=True)]
    root: _Node | None = None
    for i, box in enumerate(boxes):
        root = _insert(root, _Node(box, polygon=i))
    ranks = np.empty(len(boxes), dtype=np.int64)
    rest = [root] if root else []
    met = 0
    while rest:
        node = rest.pop()
        if node.children:
            rest += reversed(node.children)
        else:
            ranks[node.polygon] = met
            met += 1
    return ranks


class _Box(tuple):
    """A bounding box (left, bottom, right, top)."""

    def __new__(cls, *sides: float) -> '_Box':
        return super().__new__(cls, sides)

    @property
    def area(self) -> float:
        return (self[2] - self[0]) * (self[3] - self[1])

    def merged(self, other: '_Box') -> '_Box':
        return _Box(*map(min, self[:2], other[:2]), *map(max, self[2:], other[2:]))

    def distance(self, other: '_Box') -> float:
        """Return twice the distance of the centres, |x| + |y|."""
        across = self[0] + self[2] - other[0] - other[2]
        return abs(across) + abs(self[1] + self[3] - other[1] - other[3])


class _Node:
    """A node of the tree: a polygon, or two children."""

    def __init__(self, box: _Box, *children: '_Node', polygon: int = -1) -> None:
        self.box, self.children, self.polygon = box, list(children), polygon


def _insert(root: _Node | None, leaf: _Node) -> _Node:
    if root is None:
        return leaf
    path, node = [], root
    while node.children:
        path.append(node)
        a, b = (child.box for child in node.children)
        costs = b.area + a.merged(leaf.box).area, a.area + b.merged(leaf.box).area
        if costs[0] == costs[1]:
            costs = a.distance(leaf.box), b.distance(leaf.box)
        node = node.children[1 if costs[1] < costs[0] else 0]
    joined = _Node(leaf.box.merged(node.box), leaf, node)
    for parent in path:
        parent.box = parent.box.merged(leaf.box)
    if not path:
        return joined
    siblings = path[-1].children
    siblings[siblings.index(node)] = joined
    return root
