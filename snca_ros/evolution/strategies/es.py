"""The evolution strategy of the paper (section 4): the children of the mean of the best quarter."""

import numpy as np

from snca_ros.evolution.strategies.strategy import best_first


class SimpleEvolutionStrategy:
    """Children around the mean of the best quarter, and the best individual kept.

    Generation 0 is drawn from U[-1, 1]. After it, every generation is n_pop - 1 children
    mean(parents) + N(0, sigma), the parents being the best quarter of the population, and the
    best individual, whose fitness is kept and not measured again. Each generation has its own
    random stream, a function of `seed` and the generation's number alone.

    Args:
        n_parameters: length of a candidate.
        population: individuals per generation (paper: 36), at least 4.
        sigma: standard deviation of a child around the mean (paper: 0.35).
        seed: of all random numbers.
    """

    def __init__(
        self, n_parameters: int, *, population: int = 36, sigma: float = 0.35, seed: int = 0
    ) -> None:
        self.n_parameters, self.population = n_parameters, population
        self.sigma, self.seed = sigma, seed
        self.generation = 0
        self.individuals = np.empty((0, n_parameters))
        self.fitness = np.empty(0)

    def ask(self) -> np.ndarray:
        """Return the candidates to evaluate: (population, d) at first, then one fewer."""
        rng = np.random.default_rng([self.seed, self.generation])
        if self.generation == 0:
            return rng.uniform(-1.0, 1.0, (self.population, self.n_parameters))
        mean = self.individuals[: self.population // 4].mean(axis=0)
        noise = rng.standard_normal((self.population - 1, self.n_parameters))
        return mean + self.sigma * noise

    def tell(self, candidates: np.ndarray, fitness: np.ndarray) -> None:
        """Form the next population, best first, from the candidates and the old best."""
        self.individuals, self.fitness = best_first(self, candidates, fitness)
        self.generation += 1

    @property
    def best(self) -> np.ndarray:
        """Return the best individual so far, (d,)."""
        return self.individuals[0]

    def state(self) -> dict[str, np.ndarray]:
        """Return population and generation."""
        return {
            'individuals': self.individuals,
            'fitness': self.fitness,
            'generation': np.array(self.generation),
        }

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Go on from `state`."""
        self.individuals, self.fitness = state['individuals'], state['fitness']
        self.generation = int(state['generation'])

    @staticmethod
    def own_state(
        n_parameters: int, population: int, generation: int
    ) -> dict[str, tuple[int, ...]]:
        """Return nothing: individuals, fitness and generation are the whole state."""
        return {}
