"""The options `--shape` and `--without`, which put a controller into another body."""

import argparse
import tempfile
from contextlib import ExitStack
from pathlib import Path

from snca_ros.controller_file import load_controller, save_controller
from snca_ros.trained_controller import TrainedController

WITHOUT_HELP = (
    'voxels to leave out of the body: voxel_1_1,voxel_2_1,...; the others keep their names'
)


def add_body_options(parser: argparse.ArgumentParser | argparse._ArgumentGroup) -> None:
    """Add the options to a command that takes a controller."""
    parser.add_argument('--shape', default='',
                        help='another body for a uniform controller: a shape such as tripod or '
                        'comb-9x3, or a grid (default: that of its file)')
    parser.add_argument('--without', default='', metavar='VOXELS', help=WITHOUT_HELP)


def load_in_body(
    path: Path, shape: str, without: str, stack: ExitStack
) -> tuple[Path, TrainedController]:
    """Return the controller of a file in the body of the options, and a file of it for nodes.

    Args:
        path: of the controller file.
        shape, without: values of the options; '' for the body of the file.
        stack: removes the file of a controller in another body, which is temporary.

    Raises:
        InvalidInput: the file cannot be read, or the controller does not fit the body.
    """
    own = load_controller(path)
    trained = own.in_body(shape).without(without)
    if trained is own:
        return path, own
    folder = stack.enter_context(tempfile.TemporaryDirectory(prefix='snca_ros_'))
    file = Path(folder, path.name)
    save_controller(file, trained)
    return file, trained
