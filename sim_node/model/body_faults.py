"""Faults of a robot's body: sensor noise, broken sensors and broken actuators.

Random numbers are counter-based: those of a voxel at a control step depend only on the seed, the
stream, the voxel's square and the step. So each node draws the numbers of its own voxel, and an
offline episode draws the same numbers.
"""

import math
import re
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from sim_node.control_time import steps_in
from sim_node.errors import InvalidInput, near_miss
from sim_node.model.constants import Checked, constant, text_value
from sim_node.model.morphology import Morphology
from sim_node.model.sensing import add_noise
from sim_node.numerics.jit import compiled

BREAKAGES = ('zero', 'frozen', 'random')
"""Values of a broken sensor or actuator (as in 2D-VSR-Sim): 0, its last value, or random."""

OUTAGE = (
    'VOXELS[@BEGIN[-END]], times in s, voxels as a share from 0 to 1 or as names joined by +, '
    'such as 0.5@10 or voxel_0_0+voxel_1_0@5-8'
)
BREAKAGE = f'{"|".join(BREAKAGES)}:{OUTAGE}'
"""Formats of `parse_outage` and `parse_breakage`."""

STREAMS = ('broken_sensors', 'broken_actuators', 'death', 'loss')
"""Names of the streams of random numbers, one for each of these faults."""

INTACT, HELD = math.nan, math.inf
"""Entries of a table of broken values: a part that is not broken, and one that keeps its value."""

_NUMBER = r'\d+(?:\.\d*)?|\.\d+'
_NAMES = r'voxel_\d+_\d+(?:\+voxel_\d+_\d+)*'
_PATTERN = re.compile(
    rf'(?:(?P<share>{_NUMBER})|(?P<names>{_NAMES}))'
    rf'(?:@(?P<begin>{_NUMBER})(?:-(?P<end>{_NUMBER}))?)?',
    re.ASCII,
)


_ENDLESS = 1e9  # s; longer than any episode

BLOCK = 4
"""Number of random numbers that are drawn together for a voxel and control step."""


def uniform(
    seed: int, stream: str, square: tuple[int, int], first: int, n: int, block: int = 0
) -> np.ndarray:
    """Return the (n, 4) numbers in [0, 1) of a voxel at the control steps from `first` on.

    Args:
        stream: one of `STREAMS`.
        square: (x, y) of the voxel.
        block: 0 for the first four numbers, 1 for the next four; blocks are independent.
    """
    key = STREAMS.index(stream), *square, *((block,) if block else ())
    philox = np.random.Philox(np.random.SeedSequence(seed, spawn_key=key))
    philox.advance(first)  # a tick of its counter gives four numbers
    return np.random.Generator(philox).random((n, BLOCK))


@dataclass(frozen=True)
class Outage:
    """The failure of some voxels for some time.

    Attributes:
        voxels: names of the voxels, or a share of all voxels, which are chosen by the seed.
        begin, end: begin and end of the failure [s].
    """

    voxels: tuple[str, ...] | float
    begin: float = 0.0
    end: float = math.inf

    def affected_voxels(self, morphology: Morphology, seed: int, stream: str) -> np.ndarray:
        """Return which voxels fail, (n_voxels,) bool; InvalidInput if one does not exist.

        A larger share contains the voxels of a smaller one: the seed defines their order.
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
        """Return which control steps are within the outage, bool of the shape of `steps`."""
        begin, end = (steps_in(min(time, _ENDLESS)) for time in (self.begin, self.end))
        return (begin <= steps) & (steps < end)


def parse_outage(field: str, text: str) -> Outage | None:
    """Return the outage that `text` describes, None for an empty text.

    Raises:
        InvalidInput: the text is invalid; the error names `field`.
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
    """Return the breakage that `text` describes, 'KIND:' and an outage; None for an empty text.

    Raises:
        InvalidInput: the text is invalid; the error names `field`.
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
    """Faults of a robot's body; by default there are none.

    Raises:
        InvalidInput: a value is invalid.
    """

    broken_sensors: str = text_value(
        '', 'voxels whose readings are 0 (zero), keep their last values (frozen), or are random '
        'in [0, 1) (random)', BREAKAGE, parse_breakage,
    )
    broken_actuators: str = text_value(
        '', 'voxels whose actuation is 0 (zero), keeps its last value (frozen), or is random in '
        '[-1, 1) (random)', BREAKAGE, parse_breakage,
    )
    sensor_noise: float = constant(
        0.0, 0.0, 10.0, 'standard deviation of the normal noise that is added to readings'
    )
    seed: int = constant(0, 0, 2**31 - 1, 'seed of all noise and faults')

    @property
    def affect_body(self) -> bool:
        """Return whether there is a fault of the body."""
        return self.sensor_noise > 0.0 or self.broken_sensors != '' or self.broken_actuators != ''


class _BrokenParts:
    """The broken sensors or actuators of a robot, `n` per voxel, with values from `low` to 1."""

    def __init__(
        self, name: str, text: str, morphology: Morphology, seed: int, low: float, n: int
    ) -> None:
        self._n_parts = n
        self._name, self._morphology, self._seed, self._low = name, morphology, seed, low
        self._breakage = parse_breakage(name, text)
        if self._breakage:
            affected = self._breakage.outage.affected_voxels(morphology, seed, name)
            self._affected = np.flatnonzero(affected)

    def table(self, first: int, n: int) -> np.ndarray:
        """Return the table of broken values at n control steps from `first` on.

        Returns:
            (n, n_voxels, n_parts) `INTACT`, `HELD` or a value; (n, 0, n_parts) if nothing breaks.
        """
        if self._breakage is None:
            return np.empty((n, 0, self._n_parts))
        table = np.full((n, self._morphology.n_voxels, self._n_parts), INTACT)
        broken = self._breakage.outage.covers(np.arange(first, first + n))
        if self._breakage.kind != 'random':
            value = 0.0 if self._breakage.kind == 'zero' else HELD
            table[np.ix_(broken, self._affected)] = value
        elif broken.any():
            for i in self._affected:
                square = self._morphology.squares[i]
                u = np.concatenate([
                    uniform(self._seed, self._name, square, first, n, block)
                    for block in range(-(-self._n_parts // BLOCK))
                ], axis=1)[broken, : self._n_parts]
                table[broken, i] = self._low + (1.0 - self._low) * u
        return table


class Disturbance(NamedTuple):
    """The faults of a robot's body at n control steps, one row per step; arrays may be empty."""

    actuators: np.ndarray  # (n, n_voxels or 0) `INTACT`, `HELD` or the actuation instead
    noise: np.ndarray  # (n, n_voxels or 0, n_sensors) added to the readings after the step
    sensors: np.ndarray  # (n, n_voxels or 0, n_sensors) `INTACT`, `HELD` or the reading instead


@compiled
def break_values(values, instead, before):
    """Replace values by those of a table row `instead`, HELD ones by the values `before`."""
    for i in np.ndindex(instead.shape):
        if instead[i] == HELD:
            values[i] = before[i]
        elif instead[i] == instead[i]:
            values[i] = instead[i]


@compiled
def disturb_readings(readings, before, disturbance, row):
    """Add noise to readings and replace those of broken sensors.

    Args:
        readings: new readings, modified: (n_voxels, n_sensors) of one robot, or
            (n_voxels, n_sensors, W) of W robots.
        before: previous readings, for frozen sensors.
        disturbance: the faults, of as many robots.
        row: row of the `disturbance`.
    """
    add_noise(readings, disturbance.noise[row])
    break_values(readings, disturbance.sensors[row], before)


class BodyFaults:
    """Sensor noise, broken sensors and broken actuators of one robot, drawn step by step.

    Args:
        morphology: morphology of the robot.
        faults: its faults.
        n_sensors: sensors per voxel. Faults of the first four do not depend on further ones.

    Raises:
        InvalidInput: a voxel that is named in a fault does not exist.
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
        """Reset the random numbers of the noise to control step 0."""
        self._rngs = [  # one per block of sensors; the key of the first is empty
            np.random.default_rng(np.random.SeedSequence(self._seed, spawn_key=key))
            for key in [(), *((block,) for block in range(1, -(-self._n_sensors // BLOCK)))]
        ]

    def draw(self, step: int, n: int) -> Disturbance:
        """Return the faults of the actuation at n steps from `step` on, and of the readings after.

        The noise continues from the last call: its numbers are the same whether drawn step by step
        or many steps at once. `draw(-1, 1)`, before the first step, is for the first readings.
        """
        drawn = [rng.standard_normal((n, *self._noise_shape)) for rng in self._rngs]
        noise = self._sensor_noise * np.concatenate(drawn, axis=2)[..., : self._n_sensors]
        actuators = self._actuators.table(step, n)[..., 0].copy()
        return Disturbance(actuators, noise, self._sensors.table(step + 1, n))
