"""Films of walks as pictures: cameras that follow the robots, on one scale."""

from collections.abc import Sequence

import numpy as np
from PIL import Image

from sim_node.drawing import View, draw_frame
from snca_ros.rendering.film import Film

_SMOOTHING = 2.0  # width of the window that smooths the camera's way [s]

_HEADROOM, _SOIL_DEPTH = 1.5, 2.5  # shown above the robot and below the ground [m]

_LABEL_ROOM = 3.0  # the same as the headroom, with a label in it [m]


class Scene:
    """Films of the same moments, seen by cameras that follow the robots, on one scale.

    Args:
        films: at least one; the shortest counts.
        labels: one for each film, shown with how far its robot went; '' for none.
        width: of a robot's picture [pixels].
        relative_width: width of a picture over the length of the longest robot.
    """

    def __init__(
        self, films: Sequence[Film], labels: Sequence[str], width: int, relative_width: float
    ) -> None:
        self._films, self._labels = films, labels
        headroom = _LABEL_ROOM if any(labels) else _HEADROOM
        self._views = follow(films, width, relative_width, headroom)

    def __len__(self) -> int:
        return min(len(film.times) for film in self._films)

    def panels(self, i: int) -> list[Image.Image]:
        """Return a picture of each robot at moment `i`."""
        return [self._panel(k, i) for k in range(len(self._films))]

    def _panel(self, k: int, i: int) -> Image.Image:
        film, text = self._films[k], f'{self._films[k].times[i]:.1f} s'
        if self._labels[k]:
            walked = film.centers[i, 0] - film.centers[0, 0]
            text = f'{self._labels[k]}   {text}   {walked:.1f} m'
        return draw_frame(film.corners[i], film.colors[i], film.terrain, self._views[k][i], text)


def follow(
    films: Sequence[Film], width: int, relative_width: float, headroom: float
) -> list[list[View]]:
    """Return what cameras show that follow the robots smoothly: of each film one view per frame.

    Args:
        films: shown on one scale, in pictures of one size.
        width: of a picture [pixels].
        relative_width: how many lengths of the longest robot at rest a picture shows.
        headroom: at least so much is shown above a robot [m].
    """
    shown = relative_width * max(
        float(np.ptp(film.corners[0].reshape(-1, 2), axis=0).max()) for film in films
    )
    scale, ways = width / shown, [_way(film) for film in films]
    top = headroom + max(
        float((film.corners[..., 1].max(axis=(1, 2)) - ground).max())
        for film, (_, ground) in zip(films, ways, strict=True)
    )
    height = 2 * round(scale * min(top + _SOIL_DEPTH, shown) / 2)
    return [
        [View(x - shown / 2, y - _SOIL_DEPTH, scale, width, height)
         for x, y in zip(*way, strict=True)]
        for way in ways
    ]


def _way(film: Film) -> tuple[np.ndarray, np.ndarray]:
    """Return x and the height of the ground [m] at which a camera looks, both (n_frames,)."""
    x = _smooth(film.centers[:, 0], film.times)
    return x, _smooth(np.interp(x, film.terrain.x, film.terrain.y), film.times)


def _smooth(track: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the moving average of (n,) numbers, weighted with a bell."""
    step = float(np.median(np.diff(times))) if len(times) > 1 else _SMOOTHING
    half = int(_SMOOTHING / 2 / step)
    bell = np.hanning(2 * half + 3)
    return np.convolve(np.pad(track, half + 1, mode='edge'), bell / bell.sum(), mode='valid')
