"""Writes the folder of a controller's firmware: C that builds with one `make`."""

import os
import shutil
import tempfile
from pathlib import Path

from sim_node.errors import InvalidInput, check_name
from snca_ros.controller import own_parameters
from snca_ros.files import reason_of
from snca_ros.firmware.boards import BOARDS, DEFAULT_BOARD
from snca_ros.firmware.constants import CellSource
from snca_ros.trained_controller import TrainedController

SOURCE = Path(__file__).parent / 'c'
"""The folder of the C that is the same for all controllers."""

UNIFORM = 'cell'
"""Name of the one image of a uniform controller; else each voxel has an image of its name."""


def cell_sources(trained: TrainedController, name: str) -> dict[str, CellSource]:
    """Return the generated C of each image by name.

    Args:
        trained: the controller, in the arithmetic of the firmware.
        name: name of the controller, for people.

    Raises:
        InvalidInput: there is no C for the neuron model.
    """
    cell, shape = trained.architecture, trained.morphology
    names = (UNIFORM,) if cell.uniform else shape.voxel_names
    label = ''.join(c if c.isascii() and c.isprintable() and c not in '"\\?' else '_' for c in name)
    return {
        image: CellSource(
            cell, own_parameters(cell, trained.parameters, shape.n_voxels, i),
            label[:40] if cell.uniform else f'{label[:40]} {image}',
        )
        for i, image in enumerate(names)
    }


def write_firmware(
    trained: TrainedController, out: Path, name: str, board: str = DEFAULT_BOARD
) -> list[str]:
    """Write the firmware of a controller into a new folder, whole or not at all.

    Args:
        trained: the controller, in the arithmetic of the firmware.
        out: the folder; it must not exist, or be empty.
        name: name of the controller, for people.
        board: name of the board that `make` builds for.

    Returns:
        The names of the images.

    Raises:
        InvalidInput: the folder is not empty or cannot be written, the board is unknown, or there
            is no C for the neuron model.
    """
    check_name('board', board, BOARDS)
    sources = cell_sources(trained, name)
    files = {
        f'images/{image}/{file}': text for image, source in sources.items()
        for file, text in (('params.h', source.params_h()), ('weights.c', source.weights_c()))
    }
    files['board.mk'] = f'BOARD = {board}\n'
    out = out.absolute()
    if out.exists() and not (out.is_dir() and not any(out.iterdir())):
        raise InvalidInput('out', str(out), 'a folder that does not exist yet, or is empty')
    try:
        with tempfile.TemporaryDirectory(dir=out.parent, prefix=f'.{out.name}.') as place:
            made = Path(place, 'firmware')
            shutil.copytree(SOURCE, made, ignore=shutil.ignore_patterns('build'))
            for path, text in files.items():
                (made / path).parent.mkdir(parents=True, exist_ok=True)
                (made / path).write_text(text)
            os.rename(made, out)
    except OSError as error:
        expected = f'a folder that can be written ({reason_of(error)})'
        raise InvalidInput('out', str(out), expected) from None
    return [*sources]
