"""What contact with the ground's polygons needs to know beforehand."""

import numpy as np

from sim_node.numerics.jit import compiled


def most_at_once(ground: np.ndarray, length: float) -> int:
    """Return how many polygons an interval of `length` [m] in x can meet at most.

    Args:
        ground: (n, 4, 2) corners [m], counter-clockwise from the lower left, x increasing.
    """
    starts, ends = ground[:, 0, 0], ground[:, 1, 0]
    return int((np.searchsorted(starts, ends + length, side='right') - np.arange(len(ends))).max())


def polygon_rows(ground: np.ndarray) -> np.ndarray:
    """Return (n, 8): left and right x, top y at both, base y [m], the top's normal, rank.

    The rank is the place in the order in which Munk2D's broad phase meets the polygons.
    """
    (left, base), (right, _), (_, y1), (_, y0) = ground.transpose(1, 2, 0)
    length = np.hypot(right - left, y1 - y0)
    normal = (y0 - y1) / length, (right - left) / length
    return np.column_stack([left, right, y0, y1, base, *normal, query_order(ground)])


def query_order(ground: np.ndarray) -> np.ndarray:
    """Return each polygon's rank in the order in which Munk2D's broad phase meets the ground.

    A mass that touches two polygons is pushed by one after the other, and the order shows in the
    result. Munk2D keeps bounding boxes in a binary tree: a new one descends to where the areas
    grow least, and becomes the first child beside the leaf that it meets (cpBBTree.c).
    """
    boxes = np.zeros((2 * len(ground), 4))
    boxes[: len(ground)] = np.concatenate([ground.min(axis=1), ground.max(axis=1)], axis=1)
    return _query_order(boxes, len(ground))


@compiled
def _query_order(boxes, n):
    """Do so for bounding boxes (2 n, 4): left, bottom, right, top. Nodes below n are leaves."""
    children = np.full((2 * n, 2), -1)
    root, size = 0, n
    for leaf in range(1, n):
        node, parent, place = root, -1, 0
        while node >= n:
            a, b = children[node, 0], children[node, 1]
            cost_a = _area(boxes[b]) + _merged_area(boxes[a], boxes[leaf])
            cost_b = _area(boxes[a]) + _merged_area(boxes[b], boxes[leaf])
            if cost_a == cost_b:
                cost_a = _distance(boxes[a], boxes[leaf])
                cost_b = _distance(boxes[b], boxes[leaf])
            _merge(boxes[node], boxes[leaf])
            parent, place = node, 1 if cost_b < cost_a else 0
            node = children[node, place]
        for side in range(4):
            boxes[size, side] = boxes[node, side]
        _merge(boxes[size], boxes[leaf])
        children[size, 0], children[size, 1] = leaf, node
        if parent < 0:
            root = size
        else:
            children[parent, place] = size
        size += 1
    ranks, stack, depth, met = np.empty(n, np.int64), np.empty(2 * n, np.int64), 1, 0
    stack[0] = root
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if node < n:
            ranks[node] = met
            met += 1
        else:
            stack[depth], stack[depth + 1] = children[node, 1], children[node, 0]
            depth += 2
    return ranks


@compiled
def _area(box):
    return (box[2] - box[0]) * (box[3] - box[1])


@compiled
def _merged_area(a, b):
    across = max(a[2], b[2]) - min(a[0], b[0])
    return across * (max(a[3], b[3]) - min(a[1], b[1]))


@compiled
def _distance(a, b):
    """Return twice the distance of the centres, |x| + |y|."""
    return abs(a[0] + a[2] - b[0] - b[2]) + abs(a[1] + a[3] - b[1] - b[3])


@compiled
def _merge(box, other):
    """Let `box` hold `other` as well."""
    for side in range(2):
        box[side] = min(box[side], other[side])
        box[side + 2] = max(box[side + 2], other[side + 2])
