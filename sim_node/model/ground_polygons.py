"""Tables of the ground's polygons, computed once per terrain for the search for contacts."""

import numpy as np

from sim_node.numerics.jit import compiled

LEFT, RIGHT, TOP_LEFT, TOP_RIGHT, BASE, NORMAL_X, NORMAL_Y, QUERY_RANK = range(8)
"""Columns of `polygon_rows`: x of the left and the right side, y of the top at either side, y of
the base [m], unit normal of the top, rank of `query_order`."""


def most_at_once(ground: np.ndarray, length: float) -> int:
    """Return the largest number of polygons that an interval of `length` [m] in x can overlap.

    Args:
        ground: (n, 4, 2) corners [m], counter-clockwise from the lower left, x increasing.
    """
    starts, ends = ground[:, 0, 0], ground[:, 1, 0]
    return int((np.searchsorted(starts, ends + length, side='right') - np.arange(len(ends))).max())


def polygon_rows(ground: np.ndarray) -> np.ndarray:
    """Return one row per polygon, (n, 8), with the columns `LEFT` to `QUERY_RANK`.

    Args:
        ground: (n, 4, 2) corners [m], as for `most_at_once`.
    """
    (left, base), (right, _), (_, y1), (_, y0) = ground.transpose(1, 2, 0)
    length = np.hypot(right - left, y1 - y0)
    normal = (y0 - y1) / length, (right - left) / length
    return np.column_stack([left, right, y0, y1, base, *normal, query_order(ground)])


def query_order(ground: np.ndarray) -> np.ndarray:
    """Return each polygon's rank in the order in which Munk2D's broad phase reports the ground.

    The contacts of a mass that touches two polygons are solved one after the other, so the order
    affects the result. Munk2D keeps bounding boxes in a binary tree: a new box descends to the side
    where the total area grows least, and becomes the first child beside the leaf found there
    (cpBBTree.c).
    """
    boxes = np.zeros((2 * len(ground), 4))
    boxes[: len(ground)] = np.concatenate([ground.min(axis=1), ground.max(axis=1)], axis=1)
    return _query_order(boxes, len(ground))


@compiled
def _query_order(boxes, n):
    """Return `query_order` of n polygons from their bounding boxes.

    Args:
        boxes: (2 n, 4) left, bottom, right, top [m] of the tree's nodes. The first n are the
            leaves, one per polygon; the others are written here.
        n: number of polygons.
    """
    children = np.full((2 * n, 2), -1)
    root, n_nodes = 0, n
    for leaf in range(1, n):
        node, parent, child = root, -1, 0
        while node >= n:
            a, b = children[node, 0], children[node, 1]
            cost_a = _area(boxes[b]) + _merged_area(boxes[a], boxes[leaf])
            cost_b = _area(boxes[a]) + _merged_area(boxes[b], boxes[leaf])
            if cost_a == cost_b:
                cost_a = _distance(boxes[a], boxes[leaf])
                cost_b = _distance(boxes[b], boxes[leaf])
            _merge(boxes[node], boxes[leaf])
            parent, child = node, 1 if cost_b < cost_a else 0
            node = children[node, child]
        for side in range(4):
            boxes[n_nodes, side] = boxes[node, side]
        _merge(boxes[n_nodes], boxes[leaf])
        children[n_nodes, 0], children[n_nodes, 1] = leaf, node
        if parent < 0:
            root = n_nodes
        else:
            children[parent, child] = n_nodes
        n_nodes += 1
    ranks, stack, depth, n_found = np.empty(n, np.int64), np.empty(2 * n, np.int64), 1, 0
    stack[0] = root
    while depth > 0:
        depth -= 1
        node = stack[depth]
        if node < n:
            ranks[node] = n_found
            n_found += 1
        else:
            stack[depth], stack[depth + 1] = children[node, 1], children[node, 0]
            depth += 2
    return ranks


@compiled
def _area(box):
    """Return the area [m^2] of a box."""
    return (box[2] - box[0]) * (box[3] - box[1])


@compiled
def _merged_area(a, b):
    """Return the area [m^2] of the smallest box that encloses two boxes."""
    width = max(a[2], b[2]) - min(a[0], b[0])
    return width * (max(a[3], b[3]) - min(a[1], b[1]))


@compiled
def _distance(a, b):
    """Return twice the Manhattan distance of the centres of two boxes [m]."""
    return abs(a[0] + a[2] - b[0] - b[2]) + abs(a[1] + a[3] - b[1] - b[3])


@compiled
def _merge(box, other):
    """Enlarge `box` to enclose `other`."""
    for side in range(2):
        box[side] = min(box[side], other[side])
        box[side + 2] = max(box[side + 2], other[side + 2])
