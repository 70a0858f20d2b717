"""Pictures of a robot on its terrain, and the colours of voxels in pictures and in RViz."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from sim_node.model.terrain import Terrain

if TYPE_CHECKING:  # nodes need only the colours: Pillow is imported when a picture is drawn
    from PIL.Image import Image
    from PIL.ImageDraw import ImageDraw

_SKY, _SOIL, _SURFACE = '#f6f7f9', '#d9d3c7', '#6b6255'
_INK, _OUTLINE = '#2b2b2b', '#2b2b2b'

_OVERSAMPLING = 3
_LABELLED = 5  # metres between the long tick marks, which have a number


def area_colors(area_ratios: np.ndarray) -> np.ndarray:
    """Return the RGBA colours, (..., 4) in [0, 1], of area ratios relative to rest.

    Orange is contracted, pale at rest, blue expanded.
    """
    t = np.clip((np.asarray(area_ratios) - 0.75) / 0.5, 0.0, 1.0)[..., None]
    small, rest, large = np.array([[0.84, 0.37, 0.0], [0.96, 0.93, 0.82], [0.0, 0.45, 0.70]])
    rgb = np.where(t < 0.5, small + (rest - small) * 2 * t, rest + (large - rest) * (2 * t - 1))
    return np.concatenate([rgb, np.ones_like(t)], axis=-1)


@dataclass(frozen=True)
class View:
    """The part of the world that a picture shows.

    Attributes:
        left, bottom: the picture's lower left corner [m].
        scale: pixels per metre.
        width, height: size of the picture [pixels].
    """

    left: float
    bottom: float
    scale: float
    width: int
    height: int

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Return the pixel coordinates (..., 2), y downwards, of points (..., 2) [m]."""
        points = np.asarray(points, dtype=float)
        x = (points[..., 0] - self.left) * self.scale
        y = self.height - (points[..., 1] - self.bottom) * self.scale
        return np.stack([x, y], axis=-1)


def draw_frame(
    corners: np.ndarray, colors: np.ndarray, terrain: Terrain, view: View, text: str = ''
) -> 'Image':
    """Return an RGB picture of a robot.

    Args:
        corners: (n, 4, 2) outer corners [m] of its voxels.
        colors: (n, 4) RGBA in [0, 1], as from `area_colors`; A is ignored.
        terrain: the ground.
        view: the part of the world to show.
        text: caption in the upper left corner.
    """
    from PIL import Image, ImageDraw

    fine = View(
        view.left, view.bottom, view.scale * _OVERSAMPLING,
        view.width * _OVERSAMPLING, view.height * _OVERSAMPLING,
    )
    image = Image.new('RGB', (fine.width, fine.height), _SKY)
    draw = ImageDraw.Draw(image)
    _draw_ground(draw, terrain, fine)
    _draw_voxels(draw, corners, colors, fine)
    size = 0.045 * min(fine.width, 2 * fine.height)
    draw.text((0.6 * size, 0.5 * size), text, fill=_INK, anchor='lt', font=_font(size))
    return image.reduce(_OVERSAMPLING)


def _line_width(view: View) -> int:
    return max(_OVERSAMPLING, round(0.12 * view.scale))


def _font(size: float):
    from PIL import ImageFont

    return ImageFont.load_default(size)


def _draw_ground(draw: 'ImageDraw', terrain: Terrain, view: View) -> None:
    right = view.left + view.width / view.scale
    inside = (terrain.x > view.left) & (terrain.x < right)
    x = np.concatenate([[view.left], terrain.x[inside], [right]])
    y = np.concatenate([
        [terrain.height_at(view.left)], terrain.y[inside], [terrain.height_at(right)]
    ])
    surface = view.pixels(np.stack([x, y], axis=-1))
    below = [(view.width, view.height), (0, view.height)]
    draw.polygon([*map(tuple, surface), *below], fill=_SOIL)
    for mark in range(int(np.ceil(view.left)), int(right) + 1):
        long = mark % _LABELLED == 0
        height = terrain.height_at(mark)
        top, end = view.pixels(np.array([[mark, height], [mark, height - (0.9 if long else 0.4)]]))
        draw.line([tuple(top), tuple(end)], fill=_SURFACE, width=_line_width(view) // 2)
        if long and view.scale < end[0] < view.width - view.scale:
            label = f'{mark} m'
            draw.text(tuple(end), label, fill=_SURFACE, anchor='mt', font=_font(view.scale))
    draw.line([tuple(p) for p in surface], fill=_SURFACE, width=_line_width(view))


def _draw_voxels(
    draw: 'ImageDraw', corners: np.ndarray, colors: np.ndarray, view: View
) -> None:
    shapes = [[tuple(p) for p in voxel] for voxel in view.pixels(corners)]
    for shape, color in zip(shapes, (255 * colors[:, :3]).round().astype(int), strict=True):
        draw.polygon(shape, fill=tuple(color))
    for shape in shapes:
        draw.line([*shape, *shape[:2]], fill=_OUTLINE, width=_line_width(view), joint='curve')
