"""A line to a device over a connected socket."""

import contextlib
import socket

_MOST = 65536  # bytes read at once


class SocketLine:
    """A line over a connected socket: datagrams from one peer only, or a stream.

    Args:
        connected: the socket, which the line closes.
    """

    def __init__(self, connected: socket.socket) -> None:
        self._socket = connected
        self._socket.setblocking(False)

    def fileno(self) -> int:
        """Return the file descriptor, for `select`."""
        return self._socket.fileno()

    def write(self, data: bytes) -> None:
        """Send bytes; what the line cannot take is lost. OSError if the line is gone."""
        with contextlib.suppress(BlockingIOError):
            self._socket.send(data)

    def read(self) -> bytes:
        """Return what has arrived, b'' for nothing. OSError if the line is gone."""
        try:
            data = self._socket.recv(_MOST)
        except BlockingIOError:
            return b''
        if not data and self._socket.type == socket.SOCK_STREAM:
            raise ConnectionResetError('the other end has closed the line')
        return data

    def close(self) -> None:
        """Close the socket."""
        self._socket.close()
