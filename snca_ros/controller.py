"""All cells of a robot stepping together, one control step of delay between neighbours.

The offline twin of the voxel nodes.
"""

import numpy as np

from sim_node.compiled import compiled
from sim_node.errors import InvalidInput
from sim_node.morphology import OPPOSITE, Morphology
from snca_ros.cell.cells import Cells, step_cells
from snca_ros.cell.nca import Architecture

_OPPOSITE = np.array(OPPOSITE)


@compiled
def deliver(cells, neighbors):
    """Copy what each cell's neighbours sent into its inbox; silence where there is none."""
    directional = cells.outbox.shape[1] > 1
    for i in range(neighbors.shape[0]):
        for d in range(neighbors.shape[1]):
            sender = neighbors[i, d]
            if sender < 0:
                continue
            side = _OPPOSITE[d] if directional else 0
            for c in range(cells.inbox.shape[2]):
                cells.inbox[i, d, c] = cells.outbox[sender, side, c]


@compiled
def step_all(cells, neighbors, readings, step, actuation):
    """Deliver what was sent and advance all cells by control step `step`; write `actuation`."""
    deliver(cells, neighbors)
    step_cells(cells, 0, neighbors.shape[0], readings, step, actuation)


def weights_of(
    architecture: Architecture, theta: np.ndarray, n_voxels: int, voxel: int
) -> np.ndarray:
    """Return the (weights_per_cell,) part of `theta` that voxel number `voxel` runs.

    Raises:
        InvalidInput: `theta` is not a vector of architecture.n_parameters(n_voxels) numbers.
    """
    rows, row_of_voxel = _rows(architecture, theta, n_voxels)
    return rows[row_of_voxel[voxel]]


def _rows(
    architecture: Architecture, theta: np.ndarray, n_voxels: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return `theta` as (n_rows, weights_per_cell), and which row each voxel runs."""
    theta = np.asarray(theta, dtype=np.float64)
    expected = architecture.n_parameters(n_voxels)
    if theta.shape != (expected,):
        raise InvalidInput('theta', f'shape {theta.shape}', f'shape ({expected},)')
    rows = theta.reshape(-1, architecture.weights_per_cell)
    return rows, np.zeros(n_voxels, np.int64) if architecture.uniform else np.arange(n_voxels)


class Controller:
    """All cells of a robot.

    Args:
        architecture: what kind of cell.
        morphology: whose voxels the cells control.
        theta: (n_parameters,) weights; of a non-uniform architecture cell after cell.

    Attributes:
        cells: the cells, in the morphology's index order.
        step_count: control steps made.
    """

    def __init__(
        self, architecture: Architecture, morphology: Morphology, theta: np.ndarray
    ) -> None:
        n = morphology.n_voxels
        self.architecture, self.morphology = architecture, morphology
        self.cells = Cells(architecture, *_rows(architecture, theta, n))
        self.neighbors = morphology.neighbors
        self.step_count = 0

    def reset(self) -> None:
        """Start afresh: no potential, no message, step 0."""
        self.cells.reset()
        self.step_count = 0

    def step(self, readings: np.ndarray) -> np.ndarray:
        """Advance all cells by one control step.

        Args:
            readings: (n_voxels, 4) in [0, 1].

        Returns:
            (n_voxels,) actuation in [-1, 1].
        """
        actuation = np.empty(self.morphology.n_voxels)
        step_all(self.cells.state, self.neighbors, readings, self.step_count, actuation)
        self.step_count += 1
        return actuation
