"""What breaks in a robot: which voxels, from when to when, and how; all of it from one seed.

Random numbers are counter-based: those of one voxel at one control step follow from the seed, a
stream, the voxel's place and the step alone. So every node draws its own, and an offline episode
draws the same.
"""

import math
import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim_node.control_time import CONTROL_RATE
from sim_node.errors import InvalidInput, near_miss
from sim_node.model.constants import Checked, constant, text_value
from sim_node.model.morphology import Morphology
from sim_node.model.sensing import add_noise
from sim_node.numerics.jit import compiled

BREAKAGES = ('zero', 'frozen', 'random')
"""What a broken sensor or actuator gives (2D-VSR-Sim's): 0, its last value, or any."""

OUTAGE = (
    'VOXELS[@BEGIN[-END]], times in s, voxels as a share from 0 to 1 or as names joined by +, '
    'such as 0.5@10 or voxel_0_0+voxel_1_0@5-8'
)
BREAKAGE = f'{"|".join(BREAKAGES)}:{OUTAGE}'
"""How `parse_outage` and `parse_breakage` are written."""

STREAMS = ('broken_sensors', 'broken_actuators', 'death', 'loss')
"""Faults that each have random numbers of their own."""

INTACT, HELD = math.nan, math.inf
"""In a table of broken values: what is not broken, and what stays as it was."""

_NUMBER = r'\d+(?:\.\d*)?|\.\d+'
_NAMES = r'voxel_\d+_\d+(?:\+voxel_\d+_\d+)*'
_PATTERN = re.compile(
    rf'(?:(?P<share>{_NUMBER})|(?P<names>{_NAMES}))'
    rf'(?:@(?P<begin>{_NUMBER})(?:-(?P<end>{_NUMBER}))?)?',
    re.ASCII,
)


BLOCK = 4
"""Random numbers of a voxel and control step that are drawn together."""


def uniform(
    seed: int, stream: str, square: tuple[int, int], first: int, n: int, block: int = 0
) -> np.ndarray:
    """Return the (n, 4) numbers in [0, 1) of a voxel at the control steps from `first` on.

    Args:
        stream: one of `STREAMS`.
        square: (x, y) of the voxel.
        block: 0 for the first four, 1 for the next; the numbers of one depend on no other.
    """
    key = STREAMS.index(stream), *square, *((block,) if block else ())
    philox = np.random.Philox(np.random.SeedSequence(seed, spawn_key=key))
    philox.advance(first)  # a tick of its counter gives four numbers
    return np.random.Generator(philox).random((n, BLOCK))


@dataclass(frozen=True)
class Outage:
    """Some voxels fail for some time.

    Attributes:
        voxels: their names, or the share of all voxels, which the seed picks.
        begin, end: when [s].
    """

    voxels: tuple[str, ...] | float
    begin: float = 0.0
    end: float = math.inf

    def victims(self, morphology: Morphology, seed: int, stream: str) -> np.ndarray:
        """Return which voxels fail, (n_voxels,) bool; InvalidInput if one does not exist.

        A larger share adds voxels to those of a smaller one: the seed gives their order.
        """
        chosen = np.zeros(morphology.n_voxels, dtype=bool)
        if isinstance(self.voxels, tuple):
            try:
                chosen[[morphology.index_of(name) for name in self.voxels]] = True
            except InvalidInput as error:
                raise error.found_in(stream) from None
        else:
            order = np.argsort([uniform(seed, stream, s, 0, 1)[0, 0] for s in morphology.squares])
            chosen[order[: round(self.voxels * morphology.n_voxels)]] = True
        return chosen

    def covers(self, steps: np.ndarray) -> np.ndarray:
        """Tell which control steps fall into the outage."""
        begin, end = self.begin * CONTROL_RATE, self.end * CONTROL_RATE
        return (np.rint(begin) <= steps) & (steps < np.rint(end))


def parse_outage(field: str, text: str) -> Outage | None:
    """Return the outage that `text` describes, None for an empty text.

    Raises:
        InvalidInput: naming `field`.
    """
    if text == '':
        return None
    match = _PATTERN.fullmatch(text) if isinstance(text, str) else None
    if match is None:
        raise InvalidInput(field, text, OUTAGE)
    voxels = tuple(match['names'].split('+')) if match['names'] else float(match['share'])
    outage = Outage(voxels, float(match['begin'] or 0.0), float(match['end'] or math.inf))
    if outage.begin >= outage.end or (match['share'] and float(match['share']) > 1.0):
        raise InvalidInput(field, text, OUTAGE)
    return outage


@dataclass(frozen=True)
class Breakage:
    """Sensors or actuators of some voxels are broken for some time, in one of `BREAKAGES`."""

    kind: str
    outage: Outage


def parse_breakage(field: str, text: str) -> Breakage | None:
    """Return what is broken as `text` says, 'KIND:' and an outage; None for an empty text.

    Raises:
        InvalidInput: naming `field`.
    """
    if text == '':
        return None
    kind, _, rest = text.partition(':') if isinstance(text, str) else ('', '', '')
    outage = parse_outage(field, rest) if kind in BREAKAGES else None
    if outage is None:
        hint = '' if kind in BREAKAGES else near_miss(kind, BREAKAGES)
        raise InvalidInput(field, text, BREAKAGE + hint)
    return Breakage(kind, outage)


@dataclass(frozen=True)
class FaultsOfBody(Checked):
    """What goes wrong in a robot's body; by default nothing.

    Raises:
        InvalidInput: a value is off.
    """

    broken_sensors: str = text_value(
        '', 'voxels whose readings are 0 (zero), stay as they were (frozen), or are any in [0, 1) '
        '(random)', BREAKAGE, parse_breakage,
    )
    broken_actuators: str = text_value(
        '', 'voxels whose actuation is 0 (zero), stays as it was (frozen), or is any in [-1, 1) '
        '(random)', BREAKAGE, parse_breakage,
    )
    sensor_noise: float = constant(
        0.0, 0.0, 10.0, 'standard deviation of the normal noise that is added to readings'
    )
    seed: int = constant(0, 0, 2**31 - 1, 'seed of all noise and faults')


class _BrokenParts:
    """The `n` sensors or actuators of each voxel that break, with values from `low` to 1."""

    def __init__(
        self, name: str, text: str, morphology: Morphology, seed: int, low: float, n: int
    ) -> None:
        self._n_parts = n
        self._name, self._morphology, self._seed, self._low = name, morphology, seed, low
        self._breakage = parse_breakage(name, text)
        if self._breakage:
            victims = self._breakage.outage.victims(morphology, seed, name)
            self._victims = np.flatnonzero(victims)

    def table(self, first: int, n: int) -> np.ndarray:
        """Return what is there instead, (n, n_voxels, n_parts), at n control steps from `first` on.

        That is `INTACT`, `HELD` or a value; (n, 0, n_parts) if nothing ever breaks.
        """
        if self._breakage is None:
            return np.empty((n, 0, self._n_parts))
        table = np.full((n, self._morphology.n_voxels, self._n_parts), INTACT)
        broken = self._breakage.outage.covers(np.arange(first, first + n))
        if self._breakage.kind != 'random':
            value = 0.0 if self._breakage.kind == 'zero' else HELD
            table[np.ix_(broken, self._victims)] = value
        elif broken.any():
            for i in self._victims:
                square = self._morphology.squares[i]
                u = np.concatenate([
                    uniform(self._seed, self._name, square, first, n, block)
                    for block in range(-(-self._n_parts // BLOCK))
                ], axis=1)[broken, : self._n_parts]
                table[broken, i] = self._low + (1.0 - self._low) * u
        return table


class Disturbance(NamedTuple):
    """What befalls a robot's body at n control steps, a row for each; a part may be empty."""

    actuators: np.ndarray  # (n, n_voxels) or (n, 0) `INTACT`, `HELD` or the actuation instead
    noise: np.ndarray  # (n, n_voxels or 0, n_sensors) to add to the readings of the next step
    sensors: np.ndarray  # (n, n_voxels or 0, n_sensors) `INTACT`, `HELD` or the reading instead


@compiled
def break_values(values, instead, before):
    """Put in place what a row of a table holds `instead`, or for HELD the value `before`."""
    for i in np.ndindex(instead.shape):
        if instead[i] == HELD:
            values[i] = before[i]
        elif instead[i] == instead[i]:
            values[i] = instead[i]


@compiled
def disturb_readings(readings, before, disturbance, row):
    """Add noise to (n_voxels, n_sensors) readings; break sensors, which had the values `before`."""
    add_noise(readings, disturbance.noise[row])
    break_values(readings, disturbance.sensors[row], before)


class BodyFaults:
    """Sensor noise, broken sensors and broken actuators of one robot, drawn step by step.

    Args:
        morphology: of the robot.
        faults: what goes wrong.
        n_sensors: of each voxel. What befalls the first four depends on no further ones.

    Raises:
        InvalidInput: a voxel that shall break does not exist.
    """

    def __init__(self, morphology: Morphology, faults: FaultsOfBody, n_sensors: int) -> None:
        sensor_noise, seed = faults.sensor_noise, faults.seed
        self._noise_shape = (morphology.n_voxels if sensor_noise > 0.0 else 0, BLOCK)
        self._sensor_noise, self._seed, self._n_sensors = float(sensor_noise), seed, n_sensors
        self._sensors = _BrokenParts(
            'broken_sensors', faults.broken_sensors, morphology, seed, 0.0, n_sensors
        )
        self._actuators = _BrokenParts(
            'broken_actuators', faults.broken_actuators, morphology, seed, -1.0, 1
        )
        self.reset()

    def reset(self) -> None:
        """Start anew, at control step 0."""
        self._rngs = [  # one for each block of sensors; the first is that of the seed alone
            np.random.default_rng(np.random.SeedSequence(self._seed, spawn_key=key))
            for key in [(), *((block,) for block in range(1, -(-self._n_sensors // BLOCK)))]
        ]

    def draw(self, step: int, n: int) -> Disturbance:
        """Return what befalls actuation at `step` and n - 1 steps more, readings one step later.

        The noise goes on from the last call: drawn step by step or many steps at once, the
        numbers are the same. Before the first step, `draw(-1, 1)` is for the first readings.
        """
        drawn = [rng.standard_normal((n, *self._noise_shape)) for rng in self._rngs]
        noise = self._sensor_noise * np.concatenate(drawn, axis=2)[..., : self._n_sensors]
        actuators = self._actuators.table(step, n)[..., 0].copy()
        return Disturbance(actuators, noise, self._sensors.table(step + 1, n))
