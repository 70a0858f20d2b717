"""The line to an emulated board, which runs as long as the line is open."""

import os
import socket
import subprocess
import sys
from pathlib import Path

from sim_node.errors import InvalidInput, check_name
from snca_ros.firmware.boards import BOARDS
from snca_ros.firmware.socket_line import SocketLine

# Lets the kernel kill the process when its parent ends (PR_SET_PDEATHSIG), and becomes the board,
# unless the parent has ended before that.
_LAUNCH = """
import ctypes, os, signal, sys
ctypes.CDLL(None).prctl(1, signal.SIGKILL)
os.getppid() == int(sys.argv[1]) and os.execvp(sys.argv[2], sys.argv[2:])
"""
_ARM = b'\x28\0'  # the kind of processor, bytes 18 and 19 of an image in ELF


def check_image(board: str, image: str, field: str) -> None:
    """Check the board and the image of an emulated board.

    Raises:
        InvalidInput: there is no such board or image, or no emulator.
    """
    check_name(field, board, BOARDS)
    BOARDS[board].command(Path(image))
    try:
        with open(image, 'rb') as file:
            is_arm = file.read(20)[18:] == _ARM
    except OSError:
        expected = 'an image, built by `make` in the folder of the firmware'
        raise InvalidInput(field, image, expected) from None
    if is_arm != bool(BOARDS[board].machine):
        raise InvalidInput(field, image, f'an image for {board}, built by `make BOARD={board}`')


class EmulatedLine(SocketLine):
    """A board in an emulator, a child process, with its serial line.

    It ends when the line is closed, and when this process ends in any way.

    Args:
        board: name of the board, one of `BOARDS`.
        image: path of the image.
    """

    def __init__(self, board: str, image: str) -> None:
        outer, inner = socket.socketpair()
        with inner:
            self._process = subprocess.Popen(
                [sys.executable, '-I', '-S', '-c', _LAUNCH, str(os.getpid()),
                 *BOARDS[board].command(Path(image).absolute())],
                stdin=inner.fileno(), stdout=inner.fileno(),
                start_new_session=True,  # Ctrl-C reaches only the host
            )
        super().__init__(outer)

    def close(self) -> None:
        """End the board."""
        super().close()
        self._process.kill()
        self._process.wait()
