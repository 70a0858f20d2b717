"""Faults of a robot: their description, and lost messages, late messages and dead cells.

Faults of the body are in `sim_node.model.body_faults`. A fault with the same description and seed
has the same effect in offline episodes, walks and nodes.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from sim_node.errors import InvalidInput, check_keys
from sim_node.model.body_faults import OUTAGE, FaultsOfBody, parse_outage, uniform
from sim_node.model.constants import Checked, constant, declared, text_value
from sim_node.model.morphology import DIRECTIONS, Morphology
from snca_ros.yaml_file import read_yaml


@dataclass(frozen=True)
class FaultsOfCells(Checked):
    """Faults of the cells and of the messages between them; by default there are none.

    Raises:
        InvalidInput: a value is invalid.
    """

    loss: float = constant(
        0.0, 0.0, 1.0, 'probability that a message between two cells is lost; it counts as zero',
    )
    delay: int = constant(
        0, 0, 1000, 'control steps by which messages are delayed, besides the usual one'
    )
    death: str = text_value(
        '', 'voxels that are dead (actuation 0, no messages) for a time and are then reset',
        OUTAGE, parse_outage,
    )


@dataclass(frozen=True)
class Faults(FaultsOfBody, FaultsOfCells):
    """The faults of a robot; by default there are none.

    The fields are those of the cells and of the body: `loss`, `delay`, `death`, `broken_sensors`,
    `broken_actuators`, `sensor_noise` and `seed`.

    Raises:
        InvalidInput: a value is invalid.
    """

    @classmethod
    def from_dict(cls, values: object) -> 'Faults':
        """Return the faults of a parsed YAML file; InvalidInput if a key or value is invalid."""
        if not isinstance(values, dict):
            raise InvalidInput('faults', values, 'names and values')
        check_keys('faults', values, [f.name for f in fields(cls)])
        return cls(**{name: _typed(name, value) for name, value in values.items()})

    @property
    def of_body(self) -> dict[str, Any]:
        """Return the arguments of `Simulation`, also parameters of the simulation node."""
        return {f.name: getattr(self, f.name) for f in declared(FaultsOfBody)}

    @property
    def of_cells(self) -> dict[str, Any]:
        """Return the parameters of a voxel node."""
        return {name: getattr(self, name) for name in FAULTS_OF_CELLS}

    @property
    def affect_cells(self) -> bool:
        """Return whether there is a fault of cells or messages."""
        return self.loss > 0.0 or self.delay > 0 or self.death != ''

    @property
    def any(self) -> bool:
        """Return whether there is any fault."""
        return self.affect_cells or self.affect_body


NO_FAULTS = Faults()

FAULTS_OF_CELLS = (*(f.name for f in declared(FaultsOfCells)), 'seed')
"""Names of the faults that are parameters of a voxel node."""

FAULTS_HELP = (
    f'faults as name=value,... of {", ".join(f.name for f in declared(Faults))}, such as '
    'loss=0.3,death=0.5@10, or a YAML file; see docs/robustness.md'
)
"""Help text of options that `parse_faults` reads."""


def parse_faults(text: str) -> Faults:
    """Return the faults that `text` describes.

    Args:
        text: `name=value` separated by commas, such as `loss=0.3,death=0.5@10`; or the name of a
            YAML file with the same names and values.

    Raises:
        InvalidInput: the text or the file is invalid.
    """
    if '=' in text or not text:
        return Faults.from_dict(_pairs(text))
    values = read_yaml(Path(text), 'faults as name=value,... or a YAML file with such')
    try:
        return Faults.from_dict({} if values is None else values)
    except InvalidInput as error:
        raise error.found_in(text) from None


def _pairs(text: str) -> dict[str, str]:
    pairs = {}
    for part in text.split(',') if text else ():
        name, equals, value = part.strip().partition('=')
        if not equals or name in pairs:
            raise InvalidInput('faults', part, 'name=value, each name once')
        pairs[name] = value
    return pairs


def _typed(name: str, value: object) -> Any:
    """Return a value in the type of its field: a number from a string, or a string of a number."""
    kind = type(getattr(NO_FAULTS, name))
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if kind is str and is_number:
        return f'{value:g}'
    if kind is not str and isinstance(value, str):
        try:
            return kind(value)
        except ValueError:
            pass  # the check of the field says what is expected
    return value


class CellFaults:
    """The faults of a robot's cells and messages at given control steps.

    Args:
        faults: faults of the robot.
        morphology: morphology of the robot.

    Attributes:
        delay: control steps by which every message is delayed.

    Raises:
        InvalidInput: a voxel named in `death` does not exist.
    """

    def __init__(self, faults: Faults, morphology: Morphology) -> None:
        self.delay = faults.delay
        self._loss, self._seed, self._squares = faults.loss, faults.seed, morphology.squares
        self._death = parse_outage('death', faults.death)
        if self._death:
            self._affected = self._death.affected_voxels(morphology, faults.seed, 'death')

    @property
    def any(self) -> bool:
        """Return whether there are any faults of cells and messages."""
        return bool(self.delay or self._loss or self._death)

    def lost(self, voxel: int, first: int, n: int) -> np.ndarray:
        """Return which messages to a voxel are lost at n steps from `first` on, (n, 4) bool."""
        if self._loss == 0.0:
            return np.zeros((n, len(DIRECTIONS)), dtype=bool)
        return uniform(self._seed, 'loss', self._squares[voxel], first, n) < self._loss

    def dead(self, voxel: int, first: int, n: int) -> np.ndarray:
        """Return at which of n control steps from `first` on a voxel is dead, (n,) bool."""
        if self._death is None or not self._affected[voxel]:
            return np.zeros(n, dtype=bool)
        return self._death.covers(np.arange(first, first + n))


class VoxelFaults:
    """The faults of one voxel in its node, applied step by step.

    Args:
        faults: faults of the robot.
        voxel: index of the voxel.
    """

    def __init__(self, faults: CellFaults, voxel: int) -> None:
        self._faults, self._voxel = faults, voxel
        self._delayed: dict[int, np.ndarray] = {}

    @property
    def any(self) -> bool:
        """Return whether the robot has any faults of cells and messages."""
        return self._faults.any

    def reset(self) -> None:
        """Discard all delayed messages."""
        self._delayed.clear()

    def hear(self, step: int, inbox: np.ndarray) -> np.ndarray:
        """Return the inbox of control step `step` after delay and losses.

        Messages of skipped steps are discarded.

        Args:
            step: control step.
            inbox: (4, ...) messages that arrive at this step without delay.
        """
        self._delayed[step] = inbox.copy()
        due = step - self._faults.delay
        received = self._delayed.get(due, np.zeros_like(inbox))
        for old in [k for k in self._delayed if k <= due]:
            del self._delayed[old]
        received[self._faults.lost(self._voxel, step, 1)[0]] = 0.0
        return received

    def dead(self, step: int) -> bool:
        """Return whether the voxel is dead at control step `step`."""
        return bool(self._faults.dead(self._voxel, step, 1)[0])
