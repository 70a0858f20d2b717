"""Warns if the simulation has another physics than the one that a controller was evolved in."""

from collections.abc import Callable

from sim_node.episode import physics_of_episode


class PhysicsMismatch:
    """Compares the physics of a controller with the physics of each episode.

    Args:
        path: of the controller file.
        physics: name of the physics that the controller was evolved in.
        warn: called with one line of text, once per episode with another physics.

    Attributes:
        text: short text for the diagnostics; empty if both have the same physics.
    """

    def __init__(self, path: str, physics: str, warn: Callable[[str], object]) -> None:
        self._path, self._physics, self._warn = path, physics, warn
        self._episode: bytes | None = None
        self.text = ''

    def check(self, episode: bytes) -> None:
        """Compare with the physics of the current episode."""
        if episode == self._episode:
            return
        self._episode, simulated = episode, physics_of_episode(episode)
        self.text = ''
        if simulated != self._physics:
            self.text = f'evolved in the physics {self._physics}, simulated in {simulated}'
            self._warn(
                f'{self._path} was evolved in the physics {self._physics!r}, the simulation has '
                f'{simulated!r}: the robot may walk far worse; start sim_node with '
                f'-p controller:={self._path} or -p solver.physics:={self._physics}'
            )
