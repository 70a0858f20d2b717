"""The host's end of the link to a cell on a device: frames, requests and answers.

`c/link.h` describes them. This module neither opens lines nor waits.
"""

import binascii
import struct
from typing import NamedTuple

import numpy as np

from sim_node.errors import InvalidInput
from snca_ros.cell.architecture import Architecture
from snca_ros.cell.coding import pack_trains, unpack_trains
from snca_ros.cell.models.arithmetic import ACTUATION_UNITS, ARITHMETICS, READING_UNITS
from snca_ros.firmware.identity import HASH_SIZE, Identity

HELLO = b'H'
"""The request for a device's `Hello`."""

_MOST_FRAME = 8192  # bytes; a longer one is noise
_HELLO = struct.Struct(f'<5B{HASH_SIZE}sHI')
_SESSION, _STEP = struct.Struct('<cH'), struct.Struct('<cHI')
_DTYPES = {'double': '<f8', 'float32': '<f4', 'int16': '<u2', 'int8': '<u2'}


def frame(payload: bytes) -> bytes:
    """Return the bytes that carry a payload over a line: COBS(payload, CRC-16), 0."""
    checked = payload + struct.pack('<H', binascii.crc_hqx(payload, 0xFFFF))
    blocks = bytearray()
    for part in checked.split(b'\0'):
        whole = len(part) // 254 * 254
        for at in range(0, whole, 254):
            blocks += b'\xff' + part[at : at + 254]
        blocks += bytes([len(part) - whole + 1]) + part[whole:]
    return bytes(blocks) + b'\0'


def payload_of(framed: bytes) -> bytes | None:
    """Return the payload of a frame without its final 0; None if the frame is damaged."""
    checked, at = bytearray(), 0
    while at < len(framed):
        block = framed[at]
        if block == 0 or at + block > len(framed):
            return None
        checked += framed[at + 1 : at + block]
        at += block
        if block < 255 and at < len(framed):
            checked.append(0)
    payload, check = bytes(checked[:-2]), checked[-2:]
    intact = payload and check == struct.pack('<H', binascii.crc_hqx(payload, 0xFFFF))
    return payload if intact else None


class FrameReader:
    """Finds frames in the bytes that a line delivers.

    Attributes:
        damaged: number of damaged frames so far.
    """

    def __init__(self) -> None:
        self.damaged = 0
        self._rest = b''

    def feed(self, received: bytes) -> list[bytes]:
        """Return the payloads of the frames that the next bytes complete."""
        *complete, rest = (self._rest + received).split(b'\0')
        self._rest = rest[:_MOST_FRAME]
        payloads = [payload_of(one) for one in complete if one]
        self.damaged += payloads.count(None)
        return [payload for payload in payloads if payload is not None]


class Hello(NamedTuple):
    """What a device says of itself."""

    identity: Identity
    session: int
    """The session that it is in; 0 after its start."""
    tick_rate: int
    """Ticks of its clock per second."""
    label: str
    """Name of its controller and voxel, for people."""


class SessionAnswer(NamedTuple):
    """The answer to a reset, or to a step of a session that the device does not know."""

    known: bool
    session: int


class StepAnswer(NamedTuple):
    """The answer to a step."""

    session: int
    step: int
    actuation: float
    """In [-1, 1]."""
    outbox: np.ndarray
    """(n_destinations, n_c, width) spikes 0.0/1.0 or values."""
    ticks: int
    """Ticks of the device's clock that the step took."""


class CellCodec:
    """Encodes requests to the cell of one architecture, and decodes its answers.

    Args:
        architecture: of the cell, with its arithmetic.
    """

    def __init__(self, architecture: Architecture) -> None:
        self._spiking, arithmetic = architecture.spiking, architecture.arithmetic
        self._integer = arithmetic in ('int16', 'int8')
        self._number = np.dtype(_DTYPES[arithmetic])
        self._word = np.dtype('<u2') if self._spiking else self._number
        self._actuation = np.dtype('<i2') if self._integer else self._number
        self._shape = architecture.n_destinations, architecture.n_c
        self._n_sent = architecture.n_destinations * architecture.n_c
        self._answer_size = (
            _STEP.size + self._actuation.itemsize + self._n_sent * self._word.itemsize + 4
        )

    def reset(self, session: int) -> bytes:
        """Return the request to reset the cell and begin a session, from 1 to 65535."""
        return _SESSION.pack(b'R', session)

    def step(self, session: int, step: int, readings: np.ndarray, inbox: np.ndarray) -> bytes:
        """Return the request of a control step.

        Args:
            session: the session.
            step: control step k, above those of this session before it.
            readings: (n_sensors,) in [0, 1].
            inbox: (4, n_c, width) spikes or values from above, left, below, right.
        """
        if self._integer:
            readings = np.floor(readings * READING_UNITS + 0.5)
        words = pack_trains(inbox) if self._spiking else inbox[..., 0]
        return b''.join([
            _STEP.pack(b'S', session, step), readings.astype(self._number).tobytes(),
            words.astype(self._word).tobytes(),
        ])

    def decode(self, payload: bytes) -> Hello | SessionAnswer | StepAnswer | None:
        """Return the answer in a payload; None if it is none of this cell."""
        kind = payload[:1]
        if kind == b'h' and len(payload) > _HELLO.size:
            return self._hello(payload[1:])
        if kind in (b'r', b'n') and len(payload) == _SESSION.size:
            return SessionAnswer(kind == b'r', _SESSION.unpack(payload)[1])
        if kind == b's' and len(payload) == self._answer_size:
            return self._step_answer(payload)
        return None

    @staticmethod
    def _hello(content: bytes) -> Hello | None:
        (
            version, arithmetic, n_sensors, n_c, n_destinations, hashed, session, tick_rate,
        ) = _HELLO.unpack_from(content)
        if arithmetic >= len(ARITHMETICS):
            return None
        identity = Identity(
            version, ARITHMETICS[arithmetic], n_sensors, n_c, n_destinations, hashed
        )
        label = content[_HELLO.size :].decode('ascii', 'replace')
        return Hello(identity, session, tick_rate, label)

    def _step_answer(self, payload: bytes) -> StepAnswer:
        _, session, step = _STEP.unpack_from(payload)
        at = _STEP.size
        (actuation,) = np.frombuffer(payload, self._actuation, 1, at)
        words = np.frombuffer(payload, self._word, self._n_sent, at + self._actuation.itemsize)
        words = words.reshape(self._shape)
        outbox = unpack_trains(words) if self._spiking else words[..., np.newaxis].astype(float)
        unit = ACTUATION_UNITS if self._integer else 1.0
        ticks = struct.unpack('<I', payload[-4:])[0]
        return StepAnswer(session, step, float(actuation) / unit, outbox, ticks)


def check_hello(hello: Hello, expected: Identity, device: str) -> None:
    """Check that a device runs the firmware of a cell.

    Args:
        hello: what the device says.
        expected: identity of the cell's firmware.
        device: name of the device, for the error.

    Raises:
        InvalidInput: it runs other firmware.
    """
    found = hello.identity
    for field, given, wanted in (
        ('protocol version', found.version, expected.version),
        ('arithmetic', found.arithmetic, expected.arithmetic),
        ('numbers of sensors, channels and destinations', _sizes(found), _sizes(expected)),
        ('firmware', f'{hello.label}, {found.hash.hex()}',
         f'that of this voxel in this controller, {expected.hash.hex()}'),
    ):
        same = found.hash == expected.hash if field == 'firmware' else given == wanted
        if not same:
            raise InvalidInput(field, given, str(wanted), device)


def _sizes(identity: Identity) -> tuple[int, int, int]:
    return identity.n_sensors, identity.n_c, identity.n_destinations
