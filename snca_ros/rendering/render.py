"""The `render` command: walks of controllers and bags as GIF, MP4 or a strip, without a screen."""

import argparse
import itertools
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from PIL import Image

from sim_node.control_time import CONTROL_RATE
from sim_node.drawing import View, draw_frame
from sim_node.errors import InvalidInput
from snca_ros.bundled import find_controller
from snca_ros.controller_file import load_controller
from snca_ros.files import write_atomically
from snca_ros.rendering.film import Film, read_film, shoot

EXAMPLES = """
  snca render biped-U-nD-snn-h walk.gif
  snca render runs/tripod/best.npz hills.gif --terrain hilly-1-10-0 --start 5 --duration 10
  snca render biped-U-nD-snn-h poses.png
  snca render biped-U-nD-snn-h bags/mine both.mp4 --label offline --label recorded --columns 1
"""

_N_POSES = 4  # in a strip
_N_COLORS = 64
_SMOOTHING = 2.0  # width of the window that smooths the camera's way [s]
_HEADROOM, _SOIL_DEPTH = 1.5, 2.5  # shown above the robot and below the ground [m]
_LABEL_ROOM = 3.0  # the same as the headroom, with a label in it [m]
_WIDTHS = {'.gif': 640, '.mp4': 640, '.png': 1280}  # of one robot's pictures
_MOST = 1920  # of all, if not told
_MOVIE_VIEW, _STRIP_VIEW = 2.4, 1.5  # width of a picture over length of the robot
_GAP = 6  # between pictures [pixels]


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `render`."""
    parser.add_argument('walks', nargs='+', metavar='WALK',
                        help='controller file (.npz), the name of one in the box, or a bag; '
                        'several are shown together, on one scale')
    parser.add_argument('out', type=Path, metavar='OUT',
                        help=f'.gif, .mp4, or .png for a strip of {_N_POSES} poses')
    parser.add_argument('--label', action='append', metavar='TEXT',
                        help='of a walk, one option for each (default, of several: their names)')
    parser.add_argument('--columns', type=int, metavar='N',
                        help='robots side by side (default: all; 1 puts them above one another)')
    parser.add_argument('--duration', type=float, default=8.0, help='seconds to show (default 8)')
    parser.add_argument('--start', type=float, default=0.0,
                        help='second of the walk to begin with (default 0)')
    parser.add_argument('--terrain', help='of controllers; default: the one of their evolution')
    parser.add_argument('--fps', type=float, default=20.0, help='pictures a second (default 20)')
    parser.add_argument('--width', type=int,
                        help=f'pixels (default 640, 1280 of a strip; up to {_MOST} for several)')


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Render as the command line says; return the exit code."""
    kind, n = args.out.suffix.lower(), len(args.walks)
    if kind not in _WIDTHS:
        raise InvalidInput('OUT', str(args.out), f'a name that ends in {", ".join(_WIDTHS)}')
    columns = 1 if kind == '.png' else n if args.columns is None else args.columns
    width = min(_MOST, columns * _WIDTHS[kind]) if args.width is None else args.width
    _check('columns', columns, 1, n)
    _check('width', width, 100 * columns, 3840)
    _check('fps', args.fps, 1, 50)
    _check('start', args.start, 0, 3600)
    _check('duration', args.duration, 1 / CONTROL_RATE, 120)
    labels = args.label or ([_name(walk) for walk in args.walks] if n > 1 else [''])
    if len(labels) != n:
        raise InvalidInput('label', labels, f'{n}, one for each walk')
    # A GIF counts in hundredths of a second.
    period = round(100 / args.fps) / 100 if kind == '.gif' else 1 / args.fps
    moments = args.start + (
        np.linspace(0.0, args.duration, _N_POSES) if kind == '.png'
        else np.arange(0.0, args.duration, period)
    )
    films = [_film(walk, args.terrain, moments) for walk in args.walks]
    across = len(films[0].times) if kind == '.png' else columns
    each = (width - (across - 1) * _GAP) // across // 2 * 2
    scene = Scene(films, labels, each, _STRIP_VIEW if kind == '.png' else _MOVIE_VIEW)
    try:
        if kind == '.png':
            write_strip(args.out, scene)
        elif kind == '.gif':
            write_gif(args.out, scene, columns, period)
        else:
            write_mp4(args.out, scene, columns, args.fps)
    except OSError as error:
        shown = f'{args.out}: {error.strerror or error}'
        raise InvalidInput('OUT', shown, 'a file that can be written') from None
    walked = [f'{film.centers[len(scene) - 1, 0] - film.centers[0, 0]:.1f} m' for film in films]
    print(f'{args.out}: {len(scene)} pictures, {" and ".join(walked)}, '
          f'{args.out.stat().st_size / 1e6:.2f} MB')
    return 0


def _check(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise InvalidInput(name, value, f'a number from {low:.3g} to {high:g}')


def _name(walk: str) -> str:
    """Return what to call a walk: the file's name, or the folder's where that says nothing."""
    path = Path(walk)
    return path.parent.name if path.name == 'best.npz' and path.parent.name else path.stem


def _film(walk: str, terrain: str | None, moments: np.ndarray) -> Film:
    if Path(walk).is_dir():
        if terrain is not None:
            raise InvalidInput('terrain', terrain, f'none: {walk} is a bag and has its own')
        return read_film(Path(walk), moments)
    trained = load_controller(find_controller(walk))
    return shoot(trained, terrain or trained.terrain, moments)


class Scene:
    """Films of the same moments, seen by cameras that follow the robots, on one scale.

    Args:
        films: at least one; the shortest counts.
        labels: one for each film, told with how far its robot went; '' for none.
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


def write_gif(path: Path, scene: Scene, columns: int, period: float) -> None:
    """Write a scene, each picture shown for `period` [s], to whole hundredths, atomically."""
    # One palette for all: small, and colours do not flicker.
    sample = [panel for i in range(0, len(scene), 1 + len(scene) // 8) for panel in scene.panels(i)]
    palette = tile(sample, 3).quantize(_N_COLORS, dither=Image.Dither.NONE)
    frames = (
        tile(scene.panels(i), columns).quantize(palette=palette, dither=Image.Dither.NONE)
        for i in range(len(scene))
    )
    write_atomically(path, lambda file: next(frames).save(
        file, format='GIF', save_all=True, append_images=frames,
        duration=round(1000 * period), loop=0, optimize=False, disposal=1,
    ))


def write_mp4(path: Path, scene: Scene, columns: int, fps: float) -> None:
    """Write a scene as H.264, atomically.

    Raises:
        InvalidInput: the extra `video` is not installed.
    """
    try:
        from imageio_ffmpeg import write_frames
    except ImportError:
        expected = ".gif, or .mp4 with the extra: pip install 'snca_ros[video]'"
        raise InvalidInput('OUT', str(path), expected) from None
    with tempfile.TemporaryDirectory() as folder:
        movie = Path(folder) / 'movie.mp4'
        frames = (tile(scene.panels(i), columns) for i in range(len(scene)))
        first = next(frames)
        ffmpeg = write_frames(
            str(movie), first.size, fps=fps, quality=7, macro_block_size=2,
            output_params=['-movflags', '+faststart'],
        )
        ffmpeg.send(None)
        for frame in itertools.chain([first], frames):
            ffmpeg.send(frame.tobytes())
        ffmpeg.close()
        write_atomically(path, lambda file: file.write(movie.read_bytes()))


def write_strip(path: Path, scene: Scene) -> None:
    """Write all pictures of each robot side by side, the robots above one another, atomically."""
    rows = zip(*(scene.panels(i) for i in range(len(scene))), strict=True)
    strip = tile([panel for row in rows for panel in row], len(scene))
    write_atomically(path, lambda file: strip.save(file, format='PNG', optimize=True))


def tile(pictures: Sequence[Image.Image], columns: int) -> Image.Image:
    """Return one picture of pictures of one size, row by row, `columns` of them in a row."""
    width, height = (side + _GAP for side in pictures[0].size)
    columns, rows = min(columns, len(pictures)), math.ceil(len(pictures) / columns)
    out = Image.new('RGB', (columns * width - _GAP, rows * height - _GAP), 'white')
    for i, picture in enumerate(pictures):
        out.paste(picture, (i % columns * width, i // columns * height))
    return out
