"""Whether the simulation has the physics that a controller was evolved in."""

from collections.abc import Callable

from sim_node.episode import physics_of_episode


class Mismatch:
    """Compares the physics of a controller with that of each episode which a voxel takes part in.

    Args:
        path: of the controller file.
        physics: the controller's.
        warn: called with one line, once in each episode that has another physics.

    Attributes:
        words: for diagnostics; empty while both have the same physics.
    """

    def __init__(self, path: str, physics: str, warn: Callable[[str], object]) -> None:
        self._path, self._physics, self._warn = path, physics, warn
        self._episode: bytes | None = None
        self.words = ''

    def note(self, episode: bytes) -> None:
        """Note the episode in which the voxel acts now."""
        if episode == self._episode:
            return
        self._episode, simulated = episode, physics_of_episode(episode)
        self.words = ''
        if simulated != self._physics:
            self.words = f'evolved in the physics {self._physics}, simulated in {simulated}'
            self._warn(
                f'{self._path} was evolved in the physics {self._physics!r}, the simulation has '
                f'{simulated!r}: the robot may walk far worse; start sim_node with '
                f'-p controller:={self._path} or -p solver.physics:={self._physics}'
            )
