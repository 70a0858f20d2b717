"""All cells of a robot in one process: the offline equivalent of the voxel nodes.

A message reaches the neighbours one control step after it was sent.
"""

from typing import NamedTuple

import numpy as np

from sim_node.errors import InvalidInput
from sim_node.model.morphology import OPPOSITE, Morphology
from sim_node.numerics.jit import compiled
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cells import Cells, reset_cells, step_cells
from snca_ros.faults import CellFaults, Faults

_OPPOSITE = np.array(OPPOSITE)


class FaultTables(NamedTuple):
    """The faults of all cells at some control steps, one row per step."""

    lost: np.ndarray  # (n_steps, n_voxels, 4) bool: messages from above, left, below, right
    dead: np.ndarray  # (n_steps, n_voxels) bool
    sent: np.ndarray  # (delay + 1, n_voxels, n_destinations, n_c) ring buffer of outboxes


@compiled
def deliver(cells, neighbors, sent):
    """Copy the messages `sent` by each cell's neighbours into its inbox."""
    directional = sent.shape[1] > 1
    for i in range(neighbors.shape[0]):
        for d in range(neighbors.shape[1]):
            sender = neighbors[i, d]
            if sender < 0:
                continue
            side = _OPPOSITE[d] if directional else 0
            for c in range(cells.inbox.shape[2]):
                cells.inbox[i, d, c] = sent[sender, side, c]


@compiled
def step_all(cells, neighbors, readings, step, actuation):
    """Deliver all messages and advance all cells by control step `step`; write `actuation`."""
    deliver(cells, neighbors, cells.outbox)
    step_cells(cells, 0, neighbors.shape[0], readings, step, actuation)


@compiled
def step_all_faulty(cells, neighbors, readings, step, actuation, faults, row):
    """Do what `step_all` does, with the faults in row `row` of the fault tables `faults`."""
    sent = faults.sent[step % faults.sent.shape[0]]  # the oldest, overwritten by the newest below
    deliver(cells, neighbors, sent)
    for i in range(neighbors.shape[0]):
        for d in range(neighbors.shape[1]):
            if faults.lost[row, i, d]:
                cells.inbox[i, d] = 0.0
    step_cells(cells, 0, neighbors.shape[0], readings, step, actuation)
    for i in range(neighbors.shape[0]):
        if faults.dead[row, i]:
            reset_cells(cells, i, i + 1)
            actuation[i] = 0.0
    sent[:] = cells.outbox


def own_parameters(
    architecture: Architecture, parameters: np.ndarray, n_voxels: int, voxel: int
) -> np.ndarray:
    """Return the part of `parameters` that the cell of a voxel uses, (parameters_per_cell,).

    Raises:
        InvalidInput: `parameters` is not a vector of architecture.n_parameters(n_voxels) numbers.
    """
    rows, row_of_voxel = _rows(architecture, parameters, n_voxels)
    return rows[row_of_voxel[voxel]]


def _rows(
    architecture: Architecture, parameters: np.ndarray, n_voxels: int
) -> tuple[np.ndarray, np.ndarray]:
    """Return `parameters` as (n_rows, parameters_per_cell), and the index of each voxel's row."""
    parameters = np.asarray(parameters, dtype=np.float64)
    expected = architecture.n_parameters(n_voxels)
    if parameters.shape != (expected,):
        raise InvalidInput('parameters', f'shape {parameters.shape}', f'shape ({expected},)')
    rows = parameters.reshape(-1, architecture.parameters_per_cell)
    return rows, np.zeros(n_voxels, np.int64) if architecture.uniform else np.arange(n_voxels)


class Controller:
    """All cells of a robot.

    Args:
        architecture: architecture of the cells.
        morphology: morphology of the robot.
        parameters: (n_parameters,) weights; in a non-uniform architecture cell after cell.
        faults: faults, of which those of cells and messages are applied here.

    Attributes:
        cells: the cells, in the morphology's order.
        step_count: number of control steps since the reset.
    """

    def __init__(
        self,
        architecture: Architecture,
        morphology: Morphology,
        parameters: np.ndarray,
        faults: Faults | None = None,
    ) -> None:
        n = morphology.n_voxels
        self.architecture, self.morphology = architecture, morphology
        self.cells = Cells(architecture, *_rows(architecture, parameters, n))
        self.neighbors = morphology.neighbors
        self.step_count = 0
        self._faults = None
        if faults and faults.affect_cells:
            self._faults = CellFaults(faults, morphology)
            self._sent = np.zeros((faults.delay + 1, *self.cells.state.outbox.shape))

    def reset(self) -> None:
        """Reset all cells, discard all messages, and set `step_count` to 0."""
        self.cells.reset()
        self.step_count = 0
        if self._faults:
            self._sent.fill(0.0)

    def step(self, readings: np.ndarray) -> np.ndarray:
        """Advance all cells by one control step.

        Args:
            readings: (n_voxels, n_sensors) in [0, 1].

        Returns:
            (n_voxels,) actuation in [-1, 1].
        """
        actuation = np.empty(self.morphology.n_voxels)
        arguments = self.cells.state, self.neighbors, readings, self.step_count, actuation
        if (faults := self.fault_tables(1)) is None:
            step_all(*arguments)
        else:
            step_all_faulty(*arguments, faults, 0)
        self.step_count += 1
        return actuation

    def fault_tables(self, n_steps: int) -> FaultTables | None:
        """Return the faults in the next `n_steps` control steps; None if there are no faults."""
        if self._faults is None:
            return None
        voxels, first = range(self.morphology.n_voxels), self.step_count
        return FaultTables(
            np.stack([self._faults.lost(i, first, n_steps) for i in voxels], axis=1),
            np.stack([self._faults.dead(i, first, n_steps) for i in voxels], axis=1),
            self._sent,
        )
