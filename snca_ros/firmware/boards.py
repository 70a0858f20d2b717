"""The boards that firmware is written for, and how to run an image on them here."""

import shutil
from dataclasses import dataclass
from pathlib import Path

from sim_node.errors import InvalidInput

EMULATOR = 'qemu-system-arm'
"""The emulator of boards."""

STDIO = 'stdio'
"""The line of standard input and output."""


@dataclass(frozen=True)
class Board:
    """A board.

    Attributes:
        processor: its processor, for people.
        machine: name of the machine of QEMU that emulates it; '' for a process of this computer.
    """

    processor: str
    machine: str = ''

    def command(self, image: Path, line: str = STDIO, *, counting: bool = False) -> list[str]:
        """Return the command that runs an image.

        Args:
            image: the image, `build/<board>/<name>.elf`.
            line: the serial line of the board: STDIO, or unix:PATH, a socket that is created.
            counting: whether the emulator counts instructions: one takes one simulated nanosecond.

        Raises:
            InvalidInput: the emulator is not installed.
        """
        if not self.machine:
            return [str(image), *([] if line == STDIO else [line])]
        if shutil.which(EMULATOR) is None:
            raise InvalidInput('board', self.machine, f'{EMULATOR} on the path, which emulates it')
        serial = line if line == STDIO else f'{line},server=on,wait=off'
        return [
            EMULATOR, '-machine', self.machine, '-kernel', str(image), '-display', 'none',
            '-monitor', 'none', '-serial', serial, *(['-icount', 'shift=0'] if counting else []),
        ]


BOARDS = {
    'posix': Board('a process of this computer'),
    'microbit': Board('BBC micro:bit V1, Cortex-M0', 'microbit'),
    'an385': Board('MPS2, Cortex-M3', 'mps2-an385'),
    'an386': Board('MPS2, Cortex-M4F', 'mps2-an386'),
    'an500': Board('MPS2, Cortex-M7', 'mps2-an500'),
}
"""All boards by name."""

DEFAULT_BOARD = 'posix'
