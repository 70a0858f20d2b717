"""Faults as configuration: one description for offline episodes, walks and nodes.

What breaks the body is done by `sim_node`; lost and late messages and the death of cells here.
A fault of the same name and seed does the same in all of them.
"""

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from sim_node.errors import InvalidInput, check_keys
from sim_node.model.body_faults import OUTAGE, FaultsOfBody, parse_outage, uniform
from sim_node.model.constants import Checked, constant, declared, text_value
from sim_node.model.morphology import DIRECTIONS, Morphology
from snca_ros.files import read_yaml


@dataclass(frozen=True)
class FaultsOfCells(Checked):
    """What goes wrong in the links between cells and in the cells; by default nothing.

    Raises:
        InvalidInput: a value is off.
    """

    loss: float = constant(
        0.0, 0.0, 1.0,
        'probability that a message is lost, per link and control step; a lost message is silence',
    )
    delay: int = constant(
        0, 0, 1000, 'control steps that every message takes, beyond the one that it always takes'
    )
    death: str = text_value(
        '', 'voxels that are limp (actuation 0) and silent for a time, and then start afresh',
        OUTAGE, parse_outage,
    )


@dataclass(frozen=True)
class Faults(FaultsOfBody, FaultsOfCells):
    """What goes wrong in a robot; by default nothing.

    Its fields are those of the body and of the cells: `loss`, `delay`, `death`, `broken_sensors`,
    `broken_actuators`, `sensor_noise` and `seed`.

    Raises:
        InvalidInput: a value is off.
    """

    @classmethod
    def from_dict(cls, values: object) -> 'Faults':
        """Return the faults of a parsed YAML file; InvalidInput if a key or value is off."""
        if not isinstance(values, dict):
            raise InvalidInput('faults', values, 'names and values')
        check_keys('faults', values, [f.name for f in fields(cls)])
        return cls(**{name: _typed(name, value) for name, value in values.items()})

    @property
    def of_body(self) -> dict[str, Any]:
        """Return what `Simulation` takes, and the simulation node as parameters."""
        return {f.name: getattr(self, f.name) for f in declared(FaultsOfBody)}

    @property
    def of_cells(self) -> dict[str, Any]:
        """Return what a voxel node takes as parameters."""
        return {name: getattr(self, name) for name in FAULTS_OF_CELLS}

    @property
    def affect_cells(self) -> bool:
        """Tell whether messages or cells are concerned at all."""
        return self.loss > 0.0 or self.delay > 0 or self.death != ''


NO_FAULTS = Faults()

FAULTS_OF_CELLS = (*(f.name for f in declared(FaultsOfCells)), 'seed')
"""The faults that a voxel node takes as parameters; their random numbers have the same seed."""

FAULTS_HELP = (
    f'what goes wrong: name=value,... of {", ".join(f.name for f in declared(Faults))}, such as '
    'loss=0.3,death=0.5@10, or a YAML file; see docs/robustness.md'
)
"""How `parse_faults` reads a text, for the help of commands."""


def parse_faults(text: str) -> Faults:
    """Return the faults that `text` describes.

    Args:
        text: `name=value` with commas between, such as `loss=0.3,death=0.5@10`; or the name of a
            YAML file that holds the same names and values.

    Raises:
        InvalidInput: naming the file, too, if it is one.
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
    """Return a value as its field has it: a number from a text, or the text of a number."""
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
    """The faults of a robot's cells and of the links between them, at any control step.

    Args:
        faults: what goes wrong.
        morphology: of the robot.

    Attributes:
        delay: control steps that every message takes longer.

    Raises:
        InvalidInput: a voxel that shall die does not exist.
    """

    def __init__(self, faults: Faults, morphology: Morphology) -> None:
        self.delay = faults.delay
        self._loss, self._seed, self._squares = faults.loss, faults.seed, morphology.squares
        self._death = parse_outage('death', faults.death)
        if self._death:
            self._mortal = self._death.victims(morphology, faults.seed, 'death')

    def lost(self, voxel: int, first: int, n: int) -> np.ndarray:
        """Return which messages to a voxel are lost, (n, 4) bool, at n steps from `first` on."""
        if self._loss == 0.0:
            return np.zeros((n, len(DIRECTIONS)), dtype=bool)
        return uniform(self._seed, 'loss', self._squares[voxel], first, n) < self._loss

    def dead(self, voxel: int, first: int, n: int) -> np.ndarray:
        """Tell at which of n control steps from `first` on a voxel is dead, (n,) bool."""
        if self._death is None or not self._mortal[voxel]:
            return np.zeros(n, dtype=bool)
        return self._death.covers(np.arange(first, first + n))


class VoxelFaults:
    """The faults of one voxel as its node meets them, step by step.

    Args:
        faults: of the robot.
        voxel: index of this one.
    """

    def __init__(self, faults: CellFaults, voxel: int) -> None:
        self._faults, self._voxel = faults, voxel
        self._on_the_way: dict[int, np.ndarray] = {}

    def reset(self) -> None:
        """Start afresh: no message is on its way."""
        self._on_the_way.clear()

    def hear(self, step: int, inbox: np.ndarray) -> np.ndarray:
        """Return what is heard at control step `step` when `inbox`, (4, ...), comes without delay.

        What a step that was left out would have heard stays unheard.
        """
        self._on_the_way[step] = inbox.copy()
        due = step - self._faults.delay
        heard = self._on_the_way.get(due, np.zeros_like(inbox))
        for old in [k for k in self._on_the_way if k <= due]:
            del self._on_the_way[old]
        heard[self._faults.lost(self._voxel, step, 1)[0]] = 0.0
        return heard

    def dead(self, step: int) -> bool:
        """Tell whether the voxel is dead at control step `step`."""
        return bool(self._faults.dead(self._voxel, step, 1)[0])
