"""Loads one voxel's part of a controller file: its cell, its faults and the physics."""

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.morphology import DIRECTIONS
from sim_node.numerics.jit import warm_up
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cells import Cells
from snca_ros.cell.models.arithmetic import DEFAULT_ARITHMETIC
from snca_ros.controller import own_parameters
from snca_ros.controller_file import load_controller
from snca_ros.faults import CellFaults, Faults, VoxelFaults
from snca_ros.firmware.device import DeviceCell
from snca_ros.firmware.identity import Identity
from snca_ros.firmware.lines import parse_address
from snca_ros.nodes.own_cell import LocalCell, OwnCell, RemoteCell

_VOXEL_NAME = re.compile(r'voxel_\d+_\d+')


@dataclass(frozen=True)
class OwnPart:
    """One voxel's part of a controller.

    Attributes:
        architecture: of the cell.
        cell: the cell, ready to step.
        faults: of this voxel.
        physics: name of the physics that the controller was evolved in.
    """

    architecture: Architecture
    cell: OwnCell
    faults: VoxelFaults
    physics: str


def check_names(voxel: str, neighbors: Sequence[str], where: str) -> None:
    """Check the names of a voxel and of its neighbours.

    Args:
        voxel: name of the voxel.
        neighbors: names by direction; empty where there is no neighbour.
        where: the source of the names, for the error.

    Raises:
        InvalidInput: a name is not voxel_<x>_<y>.
    """
    for field, value in (('voxel', voxel), *zip(DIRECTIONS, neighbors, strict=True)):
        if not _VOXEL_NAME.fullmatch(value) and (value or field == 'voxel'):
            raise InvalidInput(field, value, 'voxel_<x>_<y>', where)


def load_own_part(
    path: str, voxel: str, faults: Faults, where: str, arithmetic: str = DEFAULT_ARITHMETIC,
    device: str = '',
) -> OwnPart:
    """Load one voxel's part of a controller file and compile the cell's step.

    Args:
        path: of the controller file.
        voxel: name of the voxel.
        faults: of all cells.
        where: the source of the other arguments, for errors.
        arithmetic: arithmetic of the cell.
        device: address of the device that the cell is on; '' for a cell in this process.

    Raises:
        InvalidInput: the file cannot be read, the robot has no such voxel, a fault names a voxel
            that it does not have, or arithmetic or address are invalid.
    """
    if not path:
        raise InvalidInput('controller', path, 'a controller file (.npz)', where)
    trained = load_controller(path)
    try:
        trained = trained.in_arithmetic(arithmetic)
        address = parse_address(device) if device else None
    except InvalidInput as error:
        raise error.found_in(where) from None
    try:
        index = trained.morphology.index_of(voxel)
    except InvalidInput as error:
        raise error.found_in(path) from None
    try:
        of_cells = CellFaults(faults, trained.morphology)
    except InvalidInput as error:
        raise error.found_in(where) from None
    n_voxels = trained.morphology.n_voxels
    weights = own_parameters(trained.architecture, trained.parameters, n_voxels, index)
    cell: OwnCell
    if address:
        identity = Identity.of(trained.architecture, weights)
        cell = RemoteCell(DeviceCell(address, trained.architecture, identity))
    else:
        cell = _local_cell(trained.architecture, weights)
    return OwnPart(trained.architecture, cell, VoxelFaults(of_cells, index), trained.solver.physics)


def _local_cell(architecture: Architecture, weights: np.ndarray) -> LocalCell:
    """Return a cell of this process after its step was compiled."""
    cells, readings = Cells(architecture, weights[np.newaxis]), np.zeros(len(architecture.sensors))
    name = f'cell-{architecture.arithmetic}'
    warm_up(name, lambda: cells.step_cell(0, readings, cells.empty_inbox(), 0))
    return LocalCell(cells)
