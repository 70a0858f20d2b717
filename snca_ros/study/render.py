"""The `render` command: a walking controller as a GIF or a strip of pictures, without ROS."""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from PIL import Image

from sim_node.errors import InvalidInput
from sim_node.render import View, draw_frame
from sim_node.simulation import Diverged, Simulation
from sim_node.stamps import CONTROL_RATE
from sim_node.terrain import Terrain
from snca_ros.box import find_controller
from snca_ros.controller_file import TrainedController, load_controller
from snca_ros.files import write_atomically

EXAMPLES = """
  snca render biped-U-nD-snn-h walk.gif
  snca render runs/tripod/best.npz hills.gif --terrain hilly-1-10-0 --start 5 --duration 10
  snca render biped-U-nD-snn-h poses.png
"""

_N_POSES = 4  # in a strip
_N_COLORS = 64
_SMOOTHING = 2.0  # width of the window that smooths the camera's way [s]
_HEADROOM, _SOIL_DEPTH = 1.5, 2.5  # shown above the robot and below the ground [m]
_WIDTHS = {'.gif': 640, '.png': 1280}
_GIF_VIEW, _STRIP_VIEW = 2.4, 1.5  # width of a picture over length of the robot
_GAP = 6  # between the pictures of a strip [pixels]


@dataclass(frozen=True, eq=False)
class Film:
    """A robot at some moments of its walk.

    Attributes:
        times: (n_frames,) [s].
        centers: (n_frames, 2) centre of mass [m].
        corners: (n_frames, n_voxels, 4, 2) outer corners of the voxels [m].
        area_ratios: (n_frames, n_voxels).
        terrain: the ground.
    """

    times: np.ndarray
    centers: np.ndarray
    corners: np.ndarray
    area_ratios: np.ndarray
    terrain: Terrain


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `render`."""
    parser.add_argument('controller',
                        help='controller file (.npz), or the name of one in the box')
    parser.add_argument('out', type=Path, metavar='OUT',
                        help=f'.gif, or .png for a strip of {_N_POSES} poses')
    parser.add_argument('--duration', type=float, default=8.0, help='seconds to show (default 8)')
    parser.add_argument('--start', type=float, default=0.0,
                        help='second of the walk to begin with (default 0)')
    parser.add_argument('--terrain', help='default: the one it was evolved on')
    parser.add_argument('--fps', type=float, default=20.0, help='pictures a second (default 20)')
    parser.add_argument('--width', type=int, help='pixels (default 640 for .gif, 1280 for .png)')


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Render as the command line says; return the exit code."""
    kind = args.out.suffix.lower()
    if kind not in _WIDTHS:
        raise InvalidInput('OUT', str(args.out), 'a name that ends in .gif or .png')
    width = _WIDTHS[kind] if args.width is None else args.width
    _check('width', width, 100, 2000)
    _check('fps', args.fps, 1, 50)
    _check('start', args.start, 0, 3600)
    _check('duration', args.duration, 1 / CONTROL_RATE, 120)
    trained = load_controller(find_controller(args.controller))
    # A GIF counts in hundredths of a second.
    hundredths = round(100 / args.fps)
    times = (
        np.arange(0.0, args.duration, hundredths / 100) if kind == '.gif'
        else np.linspace(0.0, args.duration, _N_POSES)
    )
    film = shoot(trained, args.terrain or trained.terrain, args.start + times)
    try:
        if kind == '.gif':
            write_gif(args.out, film, width, hundredths)
        else:
            write_strip(args.out, film, width)
    except OSError as error:
        shown = f'{args.out}: {error.strerror}'
        raise InvalidInput('OUT', shown, 'a file that can be written') from None
    walked = film.centers[-1, 0] - film.centers[0, 0]
    print(f'{args.out}: {len(film.times)} pictures, {walked:.1f} m in {args.duration:g} s, '
          f'{args.out.stat().st_size / 1e6:.2f} MB')
    return 0


def _check(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise InvalidInput(name, value, f'a number from {low:.3g} to {high:g}')


def shoot(trained: TrainedController, terrain: str, moments: np.ndarray) -> Film:
    """Let the robot walk and keep what it looks like at `moments` [s], which increase.

    Raises:
        InvalidInput: the terrain is unknown, or the physics diverges with this controller.
    """
    simulation = Simulation(
        trained.morphology, terrain,
        material=trained.material, solver=trained.solver, engine=trained.chosen_by,
    )
    controller = trained.controller()
    readings = simulation.reset()
    times, centers, corners, area_ratios = [], [], [], []
    for wanted in np.round(moments * CONTROL_RATE).astype(int):
        while simulation.step_count < wanted:
            try:
                readings = simulation.step(controller.step(readings))
            except Diverged as error:
                raise InvalidInput('controller', str(error), 'a walk that stays finite') from None
        times.append(simulation.time)
        centers.append(simulation.center)
        corners.append(simulation.world.corners.copy())
        area_ratios.append(simulation.world.area_ratios.copy())
    return Film(
        np.array(times), np.array(centers), np.array(corners), np.array(area_ratios),
        simulation.terrain,
    )


def follow(film: Film, width: int, relative_width: float) -> list[View]:
    """Return what a camera shows that follows the robot smoothly, one view per frame.

    Args:
        width: of a picture [pixels].
        relative_width: how many lengths of the robot at rest a picture shows.
    """
    shown = relative_width * float(np.ptp(film.corners[0].reshape(-1, 2), axis=0).max())
    scale = width / shown
    x = _smooth(film.centers[:, 0], film.times)
    ground = _smooth(np.interp(x, film.terrain.x, film.terrain.y), film.times)
    top = float((film.corners[..., 1].max(axis=(1, 2)) - ground).max()) + _HEADROOM
    height = 2 * round(scale * min(top + _SOIL_DEPTH, shown) / 2)
    return [
        View(a - shown / 2, b - _SOIL_DEPTH, scale, width, height)
        for a, b in zip(x, ground, strict=True)
    ]


def _smooth(track: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the moving average of (n,) numbers, weighted with a bell."""
    step = float(np.median(np.diff(times))) if len(times) > 1 else _SMOOTHING
    half = int(_SMOOTHING / 2 / step)
    bell = np.hanning(2 * half + 3)
    return np.convolve(np.pad(track, half + 1, mode='edge'), bell / bell.sum(), mode='valid')


def _frame(film: Film, views: list[View], i: int) -> Image.Image:
    text = f'{film.times[i]:.1f} s'
    return draw_frame(film.corners[i], film.area_ratios[i], film.terrain, views[i], text)


def write_gif(path: Path, film: Film, width: int, hundredths: int) -> None:
    """Write `film`, each frame shown for that long [1/100 s], atomically."""
    views = follow(film, width, _GIF_VIEW)
    indices = range(len(views))
    # One palette for all: small, and colours do not flicker.
    sample = [_frame(film, views, i) for i in indices[:: 1 + len(views) // 8]]
    palette = side_by_side(sample).quantize(_N_COLORS, dither=Image.Dither.NONE)
    frames = (
        _frame(film, views, i).quantize(palette=palette, dither=Image.Dither.NONE)
        for i in indices
    )
    write_atomically(path, lambda file: next(frames).save(
        file, format='GIF', save_all=True, append_images=frames,
        duration=10 * hundredths, loop=0, optimize=False, disposal=1,
    ))


def write_strip(path: Path, film: Film, width: int) -> None:
    """Write all frames of `film` side by side, `width` pixels in total, atomically."""
    n = len(film.times)
    views = follow(film, (width - (n - 1) * _GAP) // n, _STRIP_VIEW)
    strip = side_by_side([_frame(film, views, i) for i in range(n)])
    write_atomically(path, lambda file: strip.save(file, format='PNG', optimize=True))


def side_by_side(frames: list[Image.Image]) -> Image.Image:
    """Return one picture of frames of one size, from left to right."""
    width, height = frames[0].size
    strip = Image.new('RGB', ((width + _GAP) * len(frames) - _GAP, height), 'white')
    for i, frame in enumerate(frames):
        strip.paste(frame, (i * (width + _GAP), 0))
    return strip
