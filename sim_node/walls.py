"""The walls that a robot met in an episode, and when."""

from typing import NamedTuple

import numpy as np

from sim_node.control_time import CONTROL_RATE


class Walls(NamedTuple):
    """The control steps at which a robot first met the walls; None if it did not meet them.

    Attributes:
        behind: the wall behind its start, where x is least.
        ahead: the wall at the end of the ground.
    """

    behind: int | None = None
    ahead: int | None = None

    @property
    def times(self) -> tuple[float | None, float | None]:
        """Return the two times [s]."""
        behind, ahead = (None if step is None else step / CONTROL_RATE for step in self)
        return behind, ahead

    def free_part(self, rows: np.ndarray) -> np.ndarray:
        """Return the rows until the wall at the end of the ground is met.

        Args:
            rows: (n, ...) one row per control step, from step 0.
        """
        return rows if self.ahead is None else rows[: self.ahead + 1]

    def describe(self) -> list[str]:
        """Return a sentence for each wall that was met."""
        behind, ahead = self.times
        found = []
        if behind is not None:
            found.append(f'met the wall behind its start at {behind:.2f} s')
        if ahead is not None:
            found.append(f'met the wall at the end of the ground at {ahead:.2f} s')
        return found


NO_WALLS = Walls()
