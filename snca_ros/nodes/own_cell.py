"""The cell of one voxel as its node steps it: in this process or on a device, with faults."""

from dataclasses import asdict
from typing import NamedTuple, Protocol

import numpy as np

from sim_node.model.morphology import DIRECTIONS
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.cells import Cells, CellState
from snca_ros.faults import VoxelFaults
from snca_ros.firmware.device import DeviceCell


class CellStep(NamedTuple):
    """What a cell computes in a control step."""

    step: int
    actuation: float
    """In [-1, 1]."""
    outbox: np.ndarray
    """(n_destinations, n_c, width) spikes 0.0/1.0 or values, for the neighbours."""


class OwnCell(Protocol):
    """A cell that is asked for a step, and then for the result until there is one."""

    def reset(self) -> None:
        """Reset the cell before its next step; give up a step without result."""

    def begin_step(self, step: int, readings: np.ndarray, inbox: np.ndarray, now: float) -> None:
        """Ask for control step `step`, see `Cells.step_cell`; `now` is the time [s]."""

    def poll(self, now: float) -> CellStep | None:
        """Return the result of the step that was asked for; None until there is one.

        Raises:
            InvalidInput: the device runs other firmware.
        """

    def counts(self) -> dict[str, int]:
        """Return counts of what happened, for the diagnostics."""

    def trouble(self) -> str:
        """Return why a device does not answer; '' as long as it does."""

    def close(self) -> None:
        """Release what the cell uses."""


class LocalCell:
    """A cell in this process.

    Args:
        cells: has one cell.
    """

    def __init__(self, cells: Cells) -> None:
        self._cells = cells
        self._result: CellStep | None = None

    def reset(self) -> None:
        """Reset the cell."""
        self._cells.reset()
        self._result = None

    @property
    def state(self) -> CellState:
        """Return the state of the cell."""
        return self._cells.state

    def begin_step(self, step: int, readings: np.ndarray, inbox: np.ndarray, now: float) -> None:
        """Step the cell."""
        actuation = self._cells.step_cell(0, readings, inbox, step)
        self._result = CellStep(step, actuation, self._cells.outbox[0])

    def poll(self, now: float) -> CellStep | None:
        """Return the result of the step."""
        result, self._result = self._result, None
        return result

    def counts(self) -> dict[str, int]:
        """Return nothing: nothing can happen."""
        return {}

    def trouble(self) -> str:
        """Return nothing: there is no device."""
        return ''

    def close(self) -> None:
        """Do nothing."""


class RemoteCell:
    """A cell on a device.

    Args:
        device: the device.
    """

    def __init__(self, device: DeviceCell) -> None:
        self._device = device
        self.reset, self.begin_step, self.close = device.reset, device.begin_step, device.close

    def poll(self, now: float) -> CellStep | None:
        """Return the answer of the device to the step; None until it arrives."""
        answer = self._device.poll(now)
        return CellStep(answer.step, answer.actuation, answer.outbox) if answer else None

    def counts(self) -> dict[str, int]:
        """Return what happened on the line."""
        return {f'device {name}': n for name, n in asdict(self._device.counts).items()}

    def trouble(self) -> str:
        """Return why the device does not answer; '' as long as it does."""
        return self._device.trouble


class FaultyCell:
    """A cell with the faults of its voxel, which makes one step at a time.

    Args:
        cell: the cell.
        faults: of the voxel.
        architecture: of the cell.
    """

    def __init__(self, cell: OwnCell, faults: VoxelFaults, architecture: Architecture) -> None:
        self._cell, self._faults, self._sizes = cell, faults, architecture
        self._busy = False
        self._result: CellStep | None = None  # of a step that needs no cell

    @property
    def busy(self) -> bool:
        """Return whether a step has begun whose result has not been returned."""
        return self._busy

    @property
    def plain_state(self) -> CellState | None:
        """Return the state of a cell in this process without faults; None of any other."""
        if isinstance(self._cell, LocalCell) and not self._faults.any:
            return self._cell.state
        return None

    def empty_inbox(self) -> np.ndarray:
        """Return an inbox without messages: zeros of shape (4, n_c, width)."""
        return np.zeros((len(DIRECTIONS), self._sizes.n_c, self._sizes.message_width))

    def reset(self) -> None:
        """Reset the cell and discard delayed messages; give up a step that has begun."""
        self._cell.reset()
        self._faults.reset()
        self._busy, self._result = False, None

    def begin_step(self, step: int, readings: np.ndarray, inbox: np.ndarray, now: float) -> None:
        """Begin control step `step`, see `OwnCell`, with the faults of that step."""
        received = self._faults.hear(step, inbox)
        if self._faults.dead(step):
            self._cell.reset()  # no spikes, no actuation, and no memory when it revives
            cell = self._sizes
            silence = np.zeros((cell.n_destinations, cell.n_c, cell.message_width))
            self._result = CellStep(step, 0.0, silence)
        else:
            self._cell.begin_step(step, readings, received, now)
        self._busy = True

    def poll(self, now: float) -> CellStep | None:
        """Return the result of the step that has begun; None until there is one.

        Between steps, this lets a device say hello, or finds it again.

        Raises:
            InvalidInput: the device runs other firmware.
        """
        result, self._result = self._result or self._cell.poll(now), None
        if result is not None:
            self._busy = False
        return result

    def counts(self) -> dict[str, int]:
        """Return counts of what happened on the line to a device, by name."""
        return self._cell.counts()

    def trouble(self) -> str:
        """Return why a device does not answer; '' as long as it does."""
        return self._cell.trouble()

    def close(self) -> None:
        """Close the line to a device."""
        self._cell.close()
