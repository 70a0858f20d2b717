"""CMA-ES, by the package `cma` of its authors (extra `cma`)."""

from importlib import metadata

import numpy as np

from sim_node.errors import InvalidInput
from snca_ros.evolution.strategies.strategy import best_first


class CovarianceMatrixAdaptation:
    """CMA-ES of the package `cma` (extra `cma`), started from 0.

    It learns the covariance of its steps. The cost per generation grows with the square of
    n_parameters, and in some generations with the cube. It receives ranks in place of fitness
    values, so only their order matters, and a failed candidate is the last.

    A `cma` object is a function of its seed and of all fitness values that it has received. These
    are its state, and `restore` passes them to it again: slower than reading a pickle, which could
    run any code.

    Args:
        n_parameters: length of a candidate.
        population: individuals per generation.
        sigma: initial standard deviation of each parameter.
        seed: of all random numbers; each generation has a random stream of its own.

    Raises:
        InvalidInput: the extra is not installed.
    """

    def __init__(
        self, n_parameters: int, *, population: int = 36, sigma: float = 0.35, seed: int = 0
    ) -> None:
        try:
            import cma
            from threadpoolctl import threadpool_limits
        except ImportError:
            expected = "es, or cma with the extra: pip install 'snca_ros[cma]'"
            raise InvalidInput('strategy', 'cma', expected) from None
        self.n_parameters, self.population, self.seed = n_parameters, population, seed
        self.generation = 0
        self.individuals = np.empty((0, n_parameters))
        self.fitness = np.empty(0)
        self._received = np.empty((0, population))
        # Sums depend on the number of threads, and a run is to have one core.
        self._one_thread = threadpool_limits.wrap(limits=1)
        self._cma = cma.CMAEvolutionStrategy(np.zeros(n_parameters), sigma, {
            'popsize': population, 'randn': self._draw, 'seed': np.nan,
            'verbose': -10, 'verb_log': 0,
        })

    def _draw(self, *shape: int) -> np.ndarray:
        return self._rng.standard_normal(shape)

    def ask(self) -> np.ndarray:
        """Return the (population, d) candidates to evaluate."""
        self._rng = np.random.default_rng([self.seed, self.generation])
        return np.array(self._one_thread(self._cma.ask)())

    def tell(self, candidates: np.ndarray, fitness: np.ndarray) -> None:
        """Take the fitness of the candidates; fewer than a population no longer matter to it."""
        received = np.full(self.population, np.nan)
        received[: len(fitness)] = fitness
        self._received = np.vstack([self._received, received])
        self._learn(candidates, fitness)
        self.individuals, self.fitness = best_first(self, candidates, fitness)

    def _learn(self, candidates: np.ndarray, fitness: np.ndarray) -> None:
        if len(fitness) == self.population:
            _, ranks = np.unique(-fitness, return_inverse=True)
            self._one_thread(self._cma.tell)(list(candidates), ranks.tolist())
        self.generation += 1

    def state(self) -> dict[str, np.ndarray]:
        """Return the best, all fitness values received so far, and the resulting mean."""
        n = self.population
        return {
            'individuals': self.individuals[:n],
            'fitness': self.fitness[:n],
            'generation': np.array(self.generation),
            'told': self._received,
            'mean': self._cma.mean.copy(),
        }

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Pass all received fitness values to a new `cma` object.

        Raises:
            InvalidInput: its mean is another one: another version of `cma` or kind of machine.
        """
        for fitness in state['told']:
            self._learn(self.ask(), fitness[~np.isnan(fitness)])
        if not np.array_equal(self._cma.mean, state['mean']):
            expected = f'what cma {metadata.version("cma")} gives on this machine'
            raise InvalidInput('mean', state['mean'].tolist(), expected)
        self.individuals, self.fitness = state['individuals'], state['fitness']
        self._received = state['told']

    @staticmethod
    def own_state(
        n_parameters: int, population: int, generation: int
    ) -> dict[str, tuple[int, ...]]:
        """Return the shapes of the fitness values received so far, and of the mean."""
        return {'told': (generation, population), 'mean': (n_parameters,)}
