"""Lines to devices: a serial port, datagrams to one peer, a local socket, an emulated board.

A line is opened by its address: serial:PATH@BAUD, udp:HOST:PORT, unix:PATH or emulated:BOARD:IMAGE.
"""

import contextlib
import os
import re
import select
import socket
import termios
from dataclasses import dataclass
from typing import Protocol

from sim_node.errors import InvalidInput
from snca_ros.firmware.emulated_line import EmulatedLine, check_image
from snca_ros.firmware.socket_line import SocketLine

EXPECTED = 'serial:PATH@BAUD, udp:HOST:PORT, unix:PATH or emulated:BOARD:IMAGE'
"""What an address is."""

_BAUDS = {
    int(name[1:]): value for name, value in vars(termios).items() if re.fullmatch(r'B\d+', name)
}
_BITS_PER_BYTE = 10  # with start and stop bit
_NETWORK_RATE = 10_000_000  # bits per second assumed of a network
_MOST = 65536  # bytes read at once


class Line(Protocol):
    """An open line; it never waits."""

    def fileno(self) -> int:
        """Return the file descriptor, for `select`."""

    def write(self, data: bytes) -> None:
        """Send bytes; what the line cannot take is lost. OSError if the line is gone."""

    def read(self) -> bytes:
        """Return what has arrived, b'' for nothing. OSError if the line is gone."""

    def close(self) -> None:
        """Close the line."""


@dataclass(frozen=True)
class Address:
    """The address of a device.

    Attributes:
        kind: 'serial', 'udp', 'unix' or 'emulated'.
        place: path or host.
        number: baud rate or port; 0 if there is none.
        board: name of the emulated board.
    """

    kind: str
    place: str
    number: int = 0
    board: str = ''

    def __str__(self) -> str:
        after = {'serial': f'@{self.number}', 'udp': f':{self.number}'}.get(self.kind, '')
        return f'{self.kind}:{self.board}{":" * bool(self.board)}{self.place}{after}'

    def duration(self, n_bytes: int) -> float:
        """Return how long a number of bytes takes on the line [s]."""
        rate = self.number if self.kind == 'serial' else _NETWORK_RATE
        return n_bytes * _BITS_PER_BYTE / rate

    def open(self) -> Line:
        """Return the opened line; OSError if there is none at present."""
        if self.kind == 'serial':
            return _SerialLine(self.place, self.number)
        if self.kind == 'udp':
            return _connected(socket.SOCK_DGRAM, (self.place, self.number))
        if self.kind == 'emulated':
            return EmulatedLine(self.board, self.place)
        return _connected(socket.SOCK_STREAM, self.place)


def parse_address(text: str, field: str = 'device') -> Address:
    """Return the address in a text.

    Raises:
        InvalidInput: it is none, its baud rate or port is invalid, or there is no such board or
            image.
    """
    kind, _, rest = text.partition(':')
    if kind == 'unix' and rest:
        return Address(kind, rest)
    if kind == 'emulated' and ':' in rest:
        board, _, image = rest.partition(':')
        check_image(board, image, field)
        return Address(kind, image, board=board)
    separator = {'serial': '@', 'udp': ':'}.get(kind, '')
    if not separator:
        raise InvalidInput(field, text, EXPECTED)
    place, _, number = rest.rpartition(separator)
    if not place or not number.isdecimal():
        raise InvalidInput(field, text, EXPECTED)
    if kind == 'serial' and int(number) not in _BAUDS:
        rates = ', '.join(str(rate) for rate in sorted(_BAUDS) if rate >= 9600)
        raise InvalidInput(field, text, f'one of the baud rates {rates}')
    if kind == 'udp' and not 0 < int(number) < 65536:
        raise InvalidInput(field, text, 'a port from 1 to 65535')
    return Address(kind, place, int(number))


def wait_for(line: Line, seconds: float) -> None:
    """Wait until something has arrived on a line, at most `seconds`."""
    select.select([line], [], [], max(0.0, seconds))


class _SerialLine:
    """A serial port in raw mode, 8 bits, no parity, one stop bit, no flow control."""

    def __init__(self, path: str, baud: int) -> None:
        self._file = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            *_, characters = termios.tcgetattr(self._file)
            control = termios.CS8 | termios.CREAD | termios.CLOCAL
            rate = _BAUDS[baud]
            settings = [0, 0, control, 0, rate, rate, characters]
            termios.tcsetattr(self._file, termios.TCSANOW, settings)
            termios.tcflush(self._file, termios.TCIOFLUSH)
        except termios.error as error:
            os.close(self._file)
            raise OSError(error.args[0], f'{path}: {error.args[1]}') from None

    def fileno(self) -> int:
        return self._file

    def write(self, data: bytes) -> None:
        with contextlib.suppress(BlockingIOError):
            os.write(self._file, data)

    def read(self) -> bytes:
        try:
            return os.read(self._file, _MOST)
        except BlockingIOError:
            return b''

    def close(self) -> None:
        os.close(self._file)


def _connected(kind: socket.SocketKind, place: str | tuple[str, int]) -> SocketLine:
    """Return a line to a local socket or to a host and port; OSError if nobody listens there."""
    family = socket.AF_UNIX if isinstance(place, str) else socket.AF_INET
    connected = socket.socket(family, kind)
    try:
        connected.connect(place)
    except OSError:
        connected.close()
        raise
    return SocketLine(connected)
