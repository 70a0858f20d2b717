"""What an optimiser is: it proposes candidates and takes their fitness."""

from typing import Protocol

import numpy as np


class Strategy(Protocol):
    """An optimiser: it proposes candidates (`ask`) and takes their fitness (`tell`).

    Attributes:
        individuals: (n, n_parameters) the best individual so far and the newest, best first.
        fitness: (n,) theirs.
    """

    individuals: np.ndarray
    fitness: np.ndarray

    def __init__(
        self, n_parameters: int, *, population: int = 36, sigma: float = 0.35, seed: int = 0
    ) -> None: ...

    def ask(self) -> np.ndarray:
        """Return the (n, n_parameters) candidates to evaluate next."""

    def tell(self, candidates: np.ndarray, fitness: np.ndarray) -> None:
        """Take the (n,) fitness of the candidates, as asked or the first of them.

        Larger is better; -inf for a failed one. Fewer than asked end the run.
        """

    def state(self) -> dict[str, np.ndarray]:
        """Return everything that `restore` needs to go on exactly from here.

        It has the entries individuals, fitness and generation, and what the strategy adds.
        """

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Go to a state returned by `state`, from a strategy newly made."""

    @staticmethod
    def own_state(
        n_parameters: int, population: int, generation: int
    ) -> dict[str, tuple[int, ...]]:
        """Return the shapes of what the strategy adds to its state after `generation` generations.

        They are arrays of float64; a checkpoint that has others is refused.
        """


def keep_best(strategy: Strategy, fitness: float) -> None:
    """Give the best individual of a strategy another fitness, with which it meets the next ones."""
    strategy.fitness = np.array([fitness, *strategy.fitness[1:]])


def best_first(
    before: Strategy, candidates: np.ndarray, fitness: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return individuals and fitness of the best before and the candidates."""
    individuals = np.concatenate([before.individuals[:1], candidates])
    fitness = np.concatenate([before.fitness[:1], fitness])
    order = np.argsort(-fitness, kind='stable')
    return individuals[order], fitness[order]
