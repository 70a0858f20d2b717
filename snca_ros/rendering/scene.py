"""Draws films of walks with cameras that follow the robots, all on one scale."""

from collections.abc import Sequence

import numpy as np
from PIL import Image

from sim_node.drawing import View, draw_frame
from snca_ros.rendering.film import Film

_SMOOTHING = 2.0  # width of the window that smooths the camera's path [s]

_HEADROOM, _SOIL_DEPTH = 1.5, 2.5  # shown above the robot and below the ground [m]

_LABEL_HEADROOM = 3.0  # headroom of a picture with a label [m]


class Scene:
    """Films of the same times, drawn by cameras that follow the robots, on one scale.

    Args:
        films: at least one; the shortest one sets the number of frames.
        labels: one per film, shown with the distance that its robot has walked; '' for none.
        width: of a robot's picture [pixels].
        relative_width: width of a picture over the length of the longest robot.
    """

    def __init__(
        self, films: Sequence[Film], labels: Sequence[str], width: int, relative_width: float
    ) -> None:
        self._films, self._labels = films, labels
        headroom = _LABEL_HEADROOM if any(labels) else _HEADROOM
        self._views = follow(films, width, relative_width, headroom)

    def __len__(self) -> int:
        return min(len(film.times) for film in self._films)

    def panels(self, i: int) -> list[Image.Image]:
        """Return a picture of each robot at frame `i`."""
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
    """Return the view of each frame of each film, of cameras that follow the robots smoothly.

    Args:
        films: shown on one scale, in pictures of one size.
        width: of a picture [pixels].
        relative_width: width of a picture over the length of the longest robot at rest.
        headroom: height shown above a robot, at least [m].
    """
    shown = relative_width * max(
        float(np.ptp(film.corners[0].reshape(-1, 2), axis=0).max()) for film in films
    )
    scale, paths = width / shown, [_camera_path(film) for film in films]
    top = headroom + max(
        float((film.corners[..., 1].max(axis=(1, 2)) - ground).max())
        for film, (_, ground) in zip(films, paths, strict=True)
    )
    height = 2 * round(scale * min(top + _SOIL_DEPTH, shown) / 2)
    return [
        [View(x - shown / 2, y - _SOIL_DEPTH, scale, width, height)
         for x, y in zip(*path, strict=True)]
        for path in paths
    ]


def _camera_path(film: Film) -> tuple[np.ndarray, np.ndarray]:
    """Return x and the height of the ground [m] that a camera points at, both (n_frames,)."""
    x = _smooth(film.centers[:, 0], film.times)
    return x, _smooth(np.interp(x, film.terrain.x, film.terrain.y), film.times)


def _smooth(track: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the moving average of (n,) numbers with a Hann window."""
    step = float(np.median(np.diff(times))) if len(times) > 1 else _SMOOTHING
    half = int(_SMOOTHING / 2 / step)
    window = np.hanning(2 * half + 3)
    return np.convolve(np.pad(track, half + 1, mode='edge'), window / window.sum(), mode='valid')
