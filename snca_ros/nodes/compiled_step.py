"""(ROS) The usual control step of a voxel in compiled code, from the readings to the messages.

A step is usual if the sensors of the next control step and the neighbours' messages of this one are
there, all with the bytes that are expected. Compiled code then takes the messages, steps the cell
and publishes. Whatever else happens is left to `voxel_core`, which decides.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from rclpy.publisher import Publisher
from rclpy.subscription import Subscription

from sim_node.model.morphology import DIRECTIONS, OPPOSITE
from sim_node.numerics.dispatch import by_attribute
from sim_node.numerics.jit import compiled, compiled_inline, entry_point, warm_up
from sim_node.ros import rcl_functions, topics
from sim_node.ros.cdr import WireFormat
from sim_node.ros.endpoints import (
    EXPECTED,
    NONE,
    OTHER,
    matches,
    numbers,
    publish,
    publishers,
    set_episode,
    set_step,
    subscriptions,
    take,
    taken,
)
from snca_ros.cell.cells import CellState, step_cells
from snca_ros.cell.coding import SNN_STEPS, pack_trains
from snca_ros.nodes.cell_messages import CellMessages
from snca_ros.nodes.own_cell import LocalCell
from snca_ros.nodes.own_part import OwnPart

_SPIKE = 255  # the pixel of a spike; others are 0
_MESSAGE, _ACTUATION = 0, 1  # the voxel's publishers
_HELD = 3  # besides NONE, EXPECTED and OTHER


@compiled
def _step(data, sensors, inputs, outputs, cells, blocks, found, step, readings, actuation):
    """Make control step `step` if it is usual; return whether it was made.

    Args:
        data: bytes of the message of sensors.
        sensors, inputs, outputs: Endpoints of the sensors, of the 4 neighbours' messages, and of
            the voxel's message and actuation.
        cells: CellState of one cell.
        blocks: (4,) which of a neighbour's messages is for this voxel.
        found: (4,) what has been taken from each neighbour, written; _HELD if its message is in
            the inbox already.
        readings: (1, n_sensors), written.
        actuation: (1,), written.
    """
    set_step(sensors, 0, step)
    if not matches(sensors, 0, data):
        return False
    readings[0] = numbers(sensors, 0)
    for value in readings[0]:
        if not 0.0 <= value <= 1.0:
            return False
    for d in range(4):
        if inputs.handles[d] != 0 and found[d] != _HELD:
            set_step(inputs, d, step - 1)
            found[d] = take(inputs, d)
            if found[d] != EXPECTED or not _read_message(
                cells.network.model, cells.inbox[0, d], inputs, d, blocks[d]
            ):
                return False
    step_cells(cells, 0, 1, readings, step, actuation)
    for output in range(2):
        set_step(outputs, output, step)
    _write_message(cells.network.model, cells.outbox[0], outputs)
    publish(outputs, _MESSAGE)
    numbers(outputs, _ACTUATION)[0] = actuation[0]
    publish(outputs, _ACTUATION)
    found[:] = NONE
    return True


@compiled_inline
def _read_trains(model, inbox, inputs, d, block):
    """Write a message for this voxel into (n_c,) inbox; return whether all pixels are valid."""
    begin, end = inputs.numbers[d]
    pixels, n_c = inputs.templates[begin:end], len(inbox)
    valid = True
    for pixel in pixels:
        valid &= (pixel == 0) | (pixel == _SPIKE)
    for c in range(n_c):
        train = 0
        for h in range(SNN_STEPS):
            train |= (pixels[(block * n_c + c) * SNN_STEPS + h] & 1) << h
        inbox[c] = train
    return valid


@compiled_inline
def _read_values(model, inbox, inputs, d, block):
    values, n_c = numbers(inputs, d), len(inbox)
    valid = True
    for value in values:
        valid &= abs(value) <= 1.0
    for c in range(n_c):
        inbox[c] = values[block * n_c + c]
    return valid


_read_message = by_attribute(
    'spiking', {True: _read_trains, False: _read_values}, 'Write a message into an inbox.'
)


@compiled_inline
def _write_trains(model, outbox, outputs):
    at = outputs.numbers[_MESSAGE, 0]
    for trains in outbox:
        for train in trains:
            for h in range(SNN_STEPS):
                outputs.templates[at] = _SPIKE * (int(train) >> h & 1)
                at += 1


@compiled_inline
def _write_values(model, outbox, outputs):
    values = numbers(outputs, _MESSAGE)
    for block in range(outbox.shape[0]):
        for c in range(outbox.shape[1]):
            values[block * outbox.shape[1] + c] = outbox[block, c]


_write_message = by_attribute(
    'spiking', {True: _write_trains, False: _write_values}, 'Write an outbox into a message.'
)


class CompiledStep:
    """Makes usual control steps of one voxel.

    Args:
        cells: state of the cell.
        directional: whether a message has a part for each direction.
        sensors: format of the sensors.
        inputs: by direction, the subscription to a neighbour's messages, which no executor serves,
            and their format.
        outputs: publisher and format of the voxel's messages and of its actuation.
    """

    def __init__(
        self,
        cells: CellState,
        directional: bool,
        sensors: WireFormat,
        inputs: Mapping[int, tuple[Subscription, WireFormat]],
        outputs: Sequence[tuple[Publisher | None, WireFormat]],
    ) -> None:
        self._cells = cells
        self._blocks = np.array(OPPOSITE if directional else [0] * len(DIRECTIONS))
        message = outputs[_MESSAGE][1]
        by_direction = [inputs.get(d, (None, message)) for d in range(len(DIRECTIONS))]
        neighbors, formats = zip(*by_direction, strict=True)
        self._sensors = subscriptions([None], [sensors], ['position'])
        self._inputs = subscriptions(neighbors, formats, ['data'] * len(DIRECTIONS))
        (to_message, message), (to_actuation, actuation) = outputs
        self._outputs = publishers(
            [to_message, to_actuation], [message, actuation], ['data', 'position']
        )
        self._found = np.full(len(DIRECTIONS), NONE)
        self._readings = np.zeros_like(cells.last_spike)
        self._actuation = np.zeros(1)
        self._next = -1  # the step that can be made; -1 for none
        model = type(cells.network.model).__name__
        self._step = warm_up(f'voxel-{model}', lambda: entry_point(_step, *self._arguments(b'')))

    def prepare(self, episode: bytes, step: int, received: Mapping[int, np.ndarray]) -> None:
        """Get ready to make the step after `step`.

        Args:
            episode: name of the episode.
            step: the last step that was made.
            received: the messages of `step` that were received already, by direction:
                (n_destinations, n_c, width) spikes or values.
        """
        for endpoints in (self._sensors, self._inputs, self._outputs):
            set_episode(endpoints, episode)
        for d, message in received.items():
            mine = message[self._blocks[d]]
            spiking = self._cells.network.model.spiking
            self._cells.inbox[0, d] = pack_trains(mine) if spiking else mine[:, 0]
            self._found[d] = _HELD
        self._next = step + 1

    def attempt(self, data: bytes) -> bool:
        """Make the next step with these sensors if it is usual; return whether it was made."""
        made = self._next >= 0 and self._step(*self._arguments(data))
        self._next = self._next + 1 if made else -1
        return made

    def _arguments(self, data: bytes) -> tuple:
        return (
            data, self._sensors, self._inputs, self._outputs, self._cells, self._blocks,
            self._found, self._next, self._readings, self._actuation,
        )

    def give_back(self) -> list[tuple[int, bytes]]:
        """End usual steps; return the messages that a failed attempt has taken, with directions."""
        self._next = -1
        directions = np.flatnonzero((self._found == EXPECTED) | (self._found == OTHER))
        self._found[:] = NONE
        return [(d, taken(self._inputs, d)) for d in directions.tolist()]


def load_step(part: OwnPart, voxel: str) -> None:
    """Load the code of the usual steps of a voxel, so that forks of this process need not.

    Args:
        part: of the voxel.
        voxel: its name.
    """
    if not (isinstance(part.cell, LocalCell) and rcl_functions.AVAILABLE):
        return
    architecture = part.architecture
    outputs = CellMessages(architecture, voxel).format, topics.actuation_format(voxel)
    CompiledStep(
        part.cell.state, architecture.directional,
        topics.sensors_format(voxel, architecture.sensors), {},
        [(None, one) for one in outputs],
    )
