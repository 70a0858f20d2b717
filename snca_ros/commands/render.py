"""The `render` command: draws walks of controllers and bags as GIF, MP4 or a strip of poses."""

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.errors import InvalidInput
from sim_node.model.constants import Checked, constant, declaration, help_of
from snca_ros.bundled import find_controller
from snca_ros.commands.body_options import add_body_options
from snca_ros.commands.declared_options import add_option
from snca_ros.commands.json_output import add_json_option
from snca_ros.controller_file import load_controller
from snca_ros.rendering.encoders import GAP, write_gif, write_mp4, write_strip
from snca_ros.rendering.film import Film, film_bag, film_offline
from snca_ros.rendering.scene import Scene

EXAMPLES = """
  snca render biped-U-nD-snn-h walk.gif
  snca render runs/tripod/best.npz hills.gif --terrain hilly-1-10-0 --start 5 --duration 10
  snca render biped-U-nD-snn-h poses.png
  snca render biped-U-nD-snn-h tripod.gif --shape tripod --without voxel_1_1
  snca render biped-U-nD-snn-h bags/mine both.mp4 --label offline --label recorded --columns 1
"""

_N_POSES = 4  # in a strip
_WIDTHS = {'.gif': 640, '.mp4': 640, '.png': 1280}  # of the pictures of one robot [pixels]
_MOST = 1920  # largest default width of several robots [pixels]
_LEAST = 100  # smallest width of one robot [pixels]
_MOVIE_VIEW, _STRIP_VIEW = 2.4, 1.5  # width of a picture over length of the robot


@dataclass(frozen=True)
class RenderOptions(Checked):
    """Options of drawing a walk."""

    duration: float = constant(8.0, 1 / CONTROL_RATE, 120.0, 'duration of the part to draw', 's')
    start: float = constant(0.0, 0.0, 3600.0, 'begin of the part to draw', 's')
    fps: float = constant(20.0, 1.0, 50.0, 'pictures per second')
    width: int = constant(_WIDTHS['.gif'], _LEAST, 3840, 'width of all pictures', 'pixels')


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Declare the command line of `render`."""
    parser.add_argument('walks', nargs='+', metavar='WALK',
                        help='controller file (.npz), the name of a bundled one, or a bag; '
                        'several are drawn together, on one scale')
    parser.add_argument('out', type=Path, metavar='OUT',
                        help=f'.gif, .mp4, or .png for a strip of {_N_POSES} poses')
    parser.add_argument('--label', action='append', metavar='TEXT',
                        help='label of a walk, one option per walk (default: names, if several)')
    parser.add_argument('--columns', type=int, metavar='N',
                        help='number of robots side by side (default: all)')
    add_option(parser, RenderOptions, 'duration')
    add_option(parser, RenderOptions, 'start')
    add_body_options(parser)
    parser.add_argument('--terrain', help='terrain of controllers (default: that of evolution)')
    add_option(parser, RenderOptions, 'fps')
    add_option(parser, RenderOptions, 'width', default=None,
               help=f'{help_of(RenderOptions, "width")[:-1]}, {_WIDTHS[".png"]} for a strip; up to '
               f'{_MOST} for several robots)')
    add_json_option(parser)


def run(args: argparse.Namespace, parser: argparse.ArgumentParser) -> int:
    """Draw walks into a file; return the exit code."""
    kind, n = args.out.suffix.lower(), len(args.walks)
    if kind not in _WIDTHS:
        raise InvalidInput('OUT', str(args.out), f'a name that ends in {", ".join(_WIDTHS)}')
    columns = 1 if kind == '.png' else n if args.columns is None else args.columns
    width = min(_MOST, columns * _WIDTHS[kind]) if args.width is None else args.width
    _check('columns', columns, 1, n)
    _check('width', width, _LEAST * columns, declaration(RenderOptions, 'width').metadata['high'])
    labels = args.label or ([_name(walk) for walk in args.walks] if n > 1 else [''])
    if len(labels) != n:
        raise InvalidInput('label', labels, f'{n} labels, one for each walk')
    # The unit of time in a GIF is a hundredth of a second.
    period = round(100 / args.fps) / 100 if kind == '.gif' else 1 / args.fps
    moments = args.start + (
        np.linspace(0.0, args.duration, _N_POSES) if kind == '.png'
        else np.arange(0.0, args.duration, period)
    )
    films = [_film(walk, args, moments) for walk in args.walks]
    across = len(films[0].times) if kind == '.png' else columns
    each = (width - (across - 1) * GAP) // across // 2 * 2
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
    walked = [film.centers[len(scene) - 1, 0] - film.centers[0, 0] for film in films]
    for walk, film in zip(args.walks, films, strict=True):
        for text in film.walls.describe():
            print(f'{walk} {text}')
    size = args.out.stat().st_size
    print(f'{args.out}: {len(scene)} pictures, {" and ".join(f"{d:.1f} m" for d in walked)}, '
          f'{size / 1e6:.2f} MB')
    args.write_json({'file': str(args.out), 'pictures': len(scene), 'bytes': size, 'walks': [
        {'name': name, 'distance': d} for name, d in zip(args.walks, walked, strict=True)
    ]})
    return 0


def _check(name: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise InvalidInput(name, value, f'a number from {low:.3g} to {high:g}')


def _name(walk: str) -> str:
    """Return the label of a walk: the name of its file, or of the folder for a best.npz."""
    path = Path(walk)
    return path.parent.name if path.name == 'best.npz' and path.parent.name else path.stem


def _film(walk: str, args: argparse.Namespace, moments: np.ndarray) -> Film:
    if Path(walk).is_dir():
        for option in ('terrain', 'shape', 'without'):
            if (value := getattr(args, option)) is not None and value != '':
                raise InvalidInput(option, value, f'no --{option}: {walk} is a bag and has its own')
        return film_bag(Path(walk), moments)
    trained = load_controller(find_controller(walk)).in_body(args.shape).without(args.without)
    return film_offline(trained, args.terrain or trained.terrain, moments)
