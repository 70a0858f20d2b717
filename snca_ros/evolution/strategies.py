"""Optimisers behind one ask/tell interface: the paper's evolution strategy, and CMA-ES."""

from collections.abc import Callable
from importlib import metadata
from typing import Protocol

import numpy as np

from sim_node.errors import InvalidInput, check_name


class Strategy(Protocol):
    """An optimiser that asks for candidates to be scored and is told their fitness.

    Attributes:
        individuals: (n, n_parameters) the best individual so far and the newest, best first.
        fitness: (n,) theirs.
    """

    individuals: np.ndarray
    fitness: np.ndarray

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
        self.individuals, self.fitness = _best_first(self, candidates, fitness)
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


class CovarianceMatrixAdaptation:
    """CMA-ES of the package `cma` (extra `cma`), started from 0.

    It learns the covariance of its steps, at a cost per generation that grows with the square of
    n_parameters and now and then the cube. It is told ranks: so it depends on the order of the
    fitness values alone, and a failed candidate is just the last.

    A `cma` object is a function of its seed and of what it was told. So that is its state, and
    `restore` tells it all again: slower than reading a pickle, which could run anybody's code.

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
        self._told = np.empty((0, population))
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
        told = np.full(self.population, np.nan)
        told[: len(fitness)] = fitness
        self._told = np.vstack([self._told, told])
        self._learn(candidates, fitness)
        self.individuals, self.fitness = _best_first(self, candidates, fitness)

    def _learn(self, candidates: np.ndarray, fitness: np.ndarray) -> None:
        if len(fitness) == self.population:
            _, ranks = np.unique(-fitness, return_inverse=True)
            self._one_thread(self._cma.tell)(list(candidates), ranks.tolist())
        self.generation += 1

    def state(self) -> dict[str, np.ndarray]:
        """Return the best, the fitness told so far, and the mean that came of it."""
        n = self.population
        return {
            'individuals': self.individuals[:n],
            'fitness': self.fitness[:n],
            'generation': np.array(self.generation),
            'told': self._told,
            'mean': self._cma.mean.copy(),
        }

    def restore(self, state: dict[str, np.ndarray]) -> None:
        """Tell all fitness again.

        Raises:
            InvalidInput: that ends elsewhere; another version of `cma` or kind of machine.
        """
        for fitness in state['told']:
            self._learn(self.ask(), fitness[~np.isnan(fitness)])
        if not np.array_equal(self._cma.mean, state['mean']):
            expected = f'what cma {metadata.version("cma")} gives on this machine'
            raise InvalidInput('mean', state['mean'].tolist(), expected)
        self.individuals, self.fitness = state['individuals'], state['fitness']
        self._told = state['told']


def _best_first(
    before: Strategy, candidates: np.ndarray, fitness: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return individuals and fitness of the best before and the candidates."""
    individuals = np.concatenate([before.individuals[:1], candidates])
    fitness = np.concatenate([before.fitness[:1], fitness])
    order = np.argsort(-fitness, kind='stable')
    return individuals[order], fitness[order]


STRATEGIES: dict[str, Callable[..., Strategy]] = {
    'es': SimpleEvolutionStrategy, 'cma': CovarianceMatrixAdaptation,
}
"""Strategies by name: the paper's, and CMA-ES."""


def check_strategy(name: object) -> None:
    """Raise InvalidInput if there is no such strategy."""
    check_name('strategy', name, STRATEGIES)
