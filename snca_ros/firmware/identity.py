"""What identifies the firmware of a cell: arithmetic, sizes, and a hash of all that it computes."""

import hashlib
import json
from dataclasses import dataclass, replace

import numpy as np

from snca_ros.cell.architecture import Architecture
from snca_ros.cell.models.arithmetic import ARITHMETICS

VERSION = 1
"""Version of the link protocol."""

HASH_SIZE = 8
"""Bytes of a hash."""


@dataclass(frozen=True)
class Identity:
    """The identity of a cell's firmware.

    Attributes:
        version: version of the link protocol.
        arithmetic: name of the arithmetic.
        n_sensors, n_c, n_destinations: sizes of its requests and answers.
        hash: of architecture and weights.
    """

    version: int
    arithmetic: str
    n_sensors: int
    n_c: int
    n_destinations: int
    hash: bytes

    @classmethod
    def of(cls, architecture: Architecture, weights: np.ndarray) -> 'Identity':
        """Return the identity of the firmware of one cell.

        Args:
            architecture: of the cell, with its arithmetic.
            weights: (parameters_per_cell,) of the cell.
        """
        # Whether other cells have the same weights makes no difference to this one.
        cell = replace(architecture, uniform=True).to_dict()
        text = json.dumps({**cell, 'arithmetic': architecture.arithmetic}, sort_keys=True)
        content = text.encode() + np.ascontiguousarray(weights, '<f8').tobytes()
        return cls(
            VERSION, architecture.arithmetic, len(architecture.sensors), architecture.n_c,
            architecture.n_destinations, hashlib.sha256(content).digest()[:HASH_SIZE],
        )

    @property
    def arithmetic_index(self) -> int:
        """Return the number of the arithmetic in the protocol."""
        return ARITHMETICS.index(self.arithmetic)
