"""Writes films of walks as GIF, as MP4, or as a strip of pictures."""

import itertools
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path

from PIL import Image

from sim_node.errors import InvalidInput
from snca_ros.files import write_atomically
from snca_ros.rendering.scene import Scene

_N_COLORS = 64
GAP = 6
"""Between pictures [pixels]."""


def write_gif(path: Path, scene: Scene, columns: int, period: float) -> None:
    """Write a scene as GIF, each picture shown for `period` [s], atomically.

    GIF rounds the period to hundredths of a second.
    """
    # One palette for all pictures makes the file small and keeps colours from flickering.
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
    """Return one picture that holds pictures of the same size in rows of `columns`."""
    width, height = (side + GAP for side in pictures[0].size)
    columns, rows = min(columns, len(pictures)), math.ceil(len(pictures) / columns)
    out = Image.new('RGB', (columns * width - GAP, rows * height - GAP), 'white')
    for i, picture in enumerate(pictures):
        out.paste(picture, (i % columns * width, i // columns * height))
    return out
