"""The boards that firmware is written for."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Board:
    """A board.

    Attributes:
        processor: its processor, for people.
        machine: name of the machine of QEMU that emulates it; '' for a process of this computer.
    """

    processor: str
    machine: str = ''


BOARDS = {
    'posix': Board('a process of this computer'),
    'microbit': Board('BBC micro:bit V1, Cortex-M0, 16 MHz', 'microbit'),
    'an385': Board('MPS2, Cortex-M3, 25 MHz', 'mps2-an385'),
    'an386': Board('MPS2, Cortex-M4F, 25 MHz', 'mps2-an386'),
    'an500': Board('MPS2, Cortex-M7, 25 MHz', 'mps2-an500'),
}
"""All boards by name."""

DEFAULT_BOARD = 'posix'
