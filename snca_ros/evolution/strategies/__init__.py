"""Optimisers behind one ask/tell interface, one file each, found by name.

To add one, write a class like those here (`strategy.Strategy` says what it needs) and call
`STRATEGIES.register`, see `sim_node.registry`.
"""

from sim_node.registry import Registry
from snca_ros.evolution.strategies.cma import CovarianceMatrixAdaptation
from snca_ros.evolution.strategies.es import SimpleEvolutionStrategy
from snca_ros.evolution.strategies.strategy import Strategy

__all__ = [
    'DEFAULT_STRATEGY', 'STRATEGIES', 'CovarianceMatrixAdaptation', 'SimpleEvolutionStrategy',
    'Strategy',
]

DEFAULT_STRATEGY = 'es'
"""The strategy of the paper."""

STRATEGIES = Registry[type[Strategy]]('strategy', {
    DEFAULT_STRATEGY: SimpleEvolutionStrategy, 'cma': CovarianceMatrixAdaptation,
})
"""Strategies by name."""
