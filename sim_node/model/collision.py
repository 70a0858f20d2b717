"""Where a square mass and a polygon of the ground overlap (Chipmunk's cpCollision).

The contact normal is the axis of least overlap among the normals of the edges (separating-axis
test; Munk2D finds the same axis by GJK and EPA). The facing edge of each shape is clipped against
that of the other, which gives up to two contact points. Values are numbers or lanes; coordinates
are relative to the mass's centre.

A polygon is (x0, x1, y0, y1, y2, tx, ty): corners (x0, y0) and (x1, y1) on top, left and right,
(x0, y2) and (x1, y2) at the base; normal (tx, ty) of its top. A mass is (c, s, h): cosine and sine
of its angle, half its side.
"""

import numpy as np

from sim_node.model.ground_polygons import (
    BASE,
    LEFT,
    NORMAL_X,
    NORMAL_Y,
    RIGHT,
    TOP_LEFT,
    TOP_RIGHT,
)
from sim_node.numerics.elementary_functions import sine_cosine
from sim_node.numerics.jit import compiled, inlined_part
from sim_node.numerics.lanes import like, select

_TINY = 2.2250738585072014e-308  # keeps a division by zero finite, as in Munk2D


@inlined_part
def polygon_from(polygons, p, x, y):
    """Return polygon p of the rows of `polygon_rows`, relative to masses at (x, y) [m]."""
    return (
        polygons[p, LEFT] - x, polygons[p, RIGHT] - x,
        polygons[p, TOP_LEFT] - y, polygons[p, TOP_RIGHT] - y, polygons[p, BASE] - y,
        polygons[p, NORMAL_X], polygons[p, NORMAL_Y],
    )


@compiled
def touches_ground(mass, half, polygons, left_sides):
    """Return whether one square mass touches the ground, by the functions that lanes use, too.

    Args:
        mass: (5,) x, y [m], angle [rad], ...
        half: half its side [m].
        polygons: (n, 8) rows of `polygon_rows`.
        left_sides: (n,) x of their left sides [m], increasing.
    """
    x, y = mass[0], mass[1]
    s, c = sine_cosine(mass[2])
    square, reach = (c, s, half), 1.5 * half
    first = max(np.searchsorted(left_sides, x - reach, 'right') - 1, 0)
    for p in range(first, np.searchsorted(left_sides, x + reach, 'right')):
        polygon = polygon_from(polygons, p, x, y)
        gaps = gaps_of_ground(polygon, square)
        if gaps[0] <= 0.0 and gaps[1] <= 0.0 and gaps[2] <= 0.0:
            nx, ny, gap = widest_gap(polygon, square, gaps)
            if gap <= 0.0:
                one, two = contact_points(polygon, square, nx, ny)
                if one[2] <= 0.0 or two[2] <= 0.0:
                    return True
    return False


@inlined_part
def gaps_of_ground(polygon, mass):
    """Return the gaps [m] along the normals of the polygon's top, left and right side.

    A negative gap is an overlap.
    """
    x0, x1, y0, _, _, tx, ty = polygon
    c, s, h = mass
    reach = h * (abs(c) + abs(s))
    over_top = -(x0 * tx + y0 * ty) - h * (abs(c * tx + s * ty) + abs(c * ty - s * tx))
    return over_top, x0 - reach, -x1 - reach


@inlined_part
def widest_gap(polygon, mass, gaps):
    """Return the axis of least overlap, as normal (nx, ny) out of the ground, and its gap [m]."""
    c, s, h = mass
    over_top, over_left, over_right = gaps
    best = like(c, polygon[5]), like(c, polygon[6]), over_top
    best = _wider(best, (-1.0, 0.0, over_left))
    best = _wider(best, (1.0, 0.0, over_right))
    low, high = _extent(c, s, polygon)
    best = _wider(best, (-c, -s, low - h))
    best = _wider(best, (c, s, -high - h))
    low, high = _extent(-s, c, polygon)
    best = _wider(best, (s, -c, low - h))
    return _wider(best, (-s, c, -high - h))


@inlined_part
def _wider(best, other):
    """Return, lane by lane, the one of two axes (n_x, n_y, gap) with the wider gap."""
    wider = other[2] > best[2]
    return (
        select(wider, other[0], best[0]),
        select(wider, other[1], best[1]),
        select(wider, other[2], best[2]),
    )


@inlined_part
def _extent(ux, uy, polygon):
    """Return the least and the greatest coordinate of the polygon's corners along axis u."""
    x0, x1, y0, y1, y2, _, _ = polygon
    a, b = ux * x0, ux * x1
    p, q, r, s = a + uy * y0, b + uy * y1, a + uy * y2, b + uy * y2
    low, high = min(min(p, q), r), max(max(p, q), r)  # noqa: PLW3301 -- lanes come in pairs
    return min(low, s), max(high, s)


@inlined_part
def contact_points(polygon, mass, nx, ny):
    """Return two points, each as x, y, depth, key; contacts where depth <= 0.

    (x, y) [m] lies on the mass, from its centre; depth [m] is negative inside the ground; the key
    identifies the corners of both shapes that define the point.
    """
    ax, ay, bx, by, corner_a, corner_b = _edge_of_mass(mass, nx, ny)
    ex, ey, fx, fy, corner_e, corner_f = _edge_of_polygon(polygon, nx, ny)
    # Each end of an edge is projected on the other edge, along the normal.
    at_a, at_b = ay * nx - ax * ny, by * nx - bx * ny
    at_e, at_f = ey * nx - ex * ny, fy * nx - fx * ny
    inv_ab, inv_ef = 1.0 / (at_b - at_a + _TINY), 1.0 / (at_f - at_e + _TINY)
    t, u = _clip((at_f - at_a) * inv_ab), _clip((at_a - at_e) * inv_ef)
    px, py = _lerp(ax, bx, t), _lerp(ay, by, t)
    depth_p = nx * (px - _lerp(ex, fx, u)) + ny * (py - _lerp(ey, fy, u))
    t, u = _clip((at_e - at_a) * inv_ab), _clip((at_b - at_e) * inv_ef)
    qx, qy = _lerp(ax, bx, t), _lerp(ay, by, t)
    depth_q = nx * (qx - _lerp(ex, fx, u)) + ny * (qy - _lerp(ey, fy, u))
    return (
        (px, py, depth_p, 4.0 * corner_a + corner_f), (qx, qy, depth_q, 4.0 * corner_b + corner_e)
    )


@inlined_part
def _edge_of_mass(mass, nx, ny):
    """Return the mass's edge that faces the ground: x, y of two corners [m], then their indices."""
    c, s, h = mass
    across, along = -(nx * c + ny * s), nx * s - ny * c
    sideways = abs(across) > abs(along)
    sign = select(sideways, select(across > 0.0, 1.0, -1.0), select(along > 0.0, 1.0, -1.0))
    qx, qy = sign * select(sideways, c, -s), sign * select(sideways, s, c)  # its outward normal
    corner_b = select(sideways, 2.0 - sign, 1.0 + sign)
    corner_a = select(corner_b == 0.0, 3.0, corner_b - 1.0)
    return h * (qx + qy), h * (qy - qx), h * (qx - qy), h * (qy + qx), corner_a, corner_b


@inlined_part
def _edge_of_polygon(polygon, nx, ny):
    """Return the polygon's edge that faces the mass: x, y of two corners [m], then their indices.

    The corners are in counter-clockwise order.
    """
    x0, x1, y0, y1, y2, tx, ty = polygon
    facing = nx * tx + ny * ty
    is_left, is_right = -nx > facing, nx > facing
    ex, ey = select(is_left, x0, x1), select(is_right, y2, select(is_left, y0, y1))
    fx, fy = select(is_right, x1, x0), select(is_right, y1, select(is_left, y2, y0))
    corner_e = select(is_left, 3.0, select(is_right, 1.0, 2.0))
    corner_f = select(is_left, 0.0, select(is_right, 2.0, 3.0))
    return ex, ey, fx, fy, corner_e, corner_f


@inlined_part
def _clip(t):
    return max(min(t, 1.0), 0.0)


@inlined_part
def _lerp(a, b, t):
    return a * (1.0 - t) + b * t
