"""Optimisers behind one ask/tell interface, one file each, found by name.

To add one, write a class like those here (`strategy.Strategy` says what it needs) and call
`register_strategy`.
"""

from sim_node.errors import InvalidInput, check_name
from snca_ros.evolution.strategies.cma import CovarianceMatrixAdaptation
from snca_ros.evolution.strategies.es import SimpleEvolutionStrategy
from snca_ros.evolution.strategies.strategy import Strategy

__all__ = [
    'DEFAULT_STRATEGY', 'STRATEGIES', 'CovarianceMatrixAdaptation', 'SimpleEvolutionStrategy',
    'Strategy', 'check_strategy', 'register_strategy',
]

DEFAULT_STRATEGY = 'es'
"""The strategy of the paper."""

STRATEGIES: dict[str, type[Strategy]] = {
    DEFAULT_STRATEGY: SimpleEvolutionStrategy, 'cma': CovarianceMatrixAdaptation,
}
"""Strategies by name."""


def register_strategy(name: str, strategy: type[Strategy]) -> None:
    """Make a strategy known in this process.

    Raises:
        InvalidInput: there is another strategy of that name.
    """
    if STRATEGIES.get(name, strategy) is not strategy:
        taken = ', '.join(STRATEGIES)
        raise InvalidInput('strategy', name, f'a name that is not taken, unlike {taken}')
    STRATEGIES[name] = strategy


def check_strategy(name: object) -> None:
    """Raise InvalidInput if there is no such strategy."""
    check_name('strategy', name, STRATEGIES)
