"""The arrays of checkpoint.npz, and their check."""

import numpy as np

from sim_node.errors import InvalidInput
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.strategies import STRATEGIES

HISTORY = ('generation', 'episodes', 'best', 'median', 'worst', 'best_so_far')
"""Columns of history.csv: the episodes so far, and scores in the unit of the run's task. best,
median and worst are those of the generation's candidates. If sets of episodes are drawn, also
best_so_far is a score on the generation's set, that of the best individual now."""

FORMER_HISTORY = tuple('evaluations' if name == 'episodes' else name for name in HISTORY)
"""Columns of history.csv in earlier versions."""

_OPTIONAL = (
    'reassessed', 'other_engine', 'population', 'population_fitness', 'wall_time', 'further',
)
"""Entries that are missing in checkpoints of some versions; they may be empty."""


def check_arrays(arrays: dict[str, np.ndarray], config: RunConfig) -> None:
    """Check the arrays of a checkpoint, and add those that it may lack.

    Args:
        arrays: the arrays by name.
        config: configuration of the run.

    Raises:
        InvalidInput: an array is missing, unknown, of another shape or type, or has a value
            that no run writes.
    """
    for name in _OPTIONAL:
        width = (config.n_parameters,) if name == 'population' else ()
        arrays.setdefault(name, np.empty((0, *width)))
    n = min(len(arrays.get('individuals', ())), config.population)
    whole = config.population if len(arrays['population']) else 0
    expected: dict[str, tuple[int, ...]] = {
        'individuals': (n, config.n_parameters),
        'fitness': (n,),
        'history': (int(arrays.get('generation', np.array(0)).flat[0]), len(HISTORY)),
        'generation': (),
        'reassessed': (min(len(arrays['reassessed']), config.n_elite),),
        'other_engine': (min(len(arrays['other_engine']), 1),),
        'further': (min(len(arrays['further']), config.n_elite if config.draw else 0),),
        'wall_time': (min(len(arrays['wall_time']), 1),),
        'population': (whole, config.n_parameters),
        'population_fitness': (whole,),
    }
    expected |= STRATEGIES[config.strategy].own_state(
        config.n_parameters, config.population, expected['history'][0]
    )
    if arrays.keys() != expected.keys():
        raise InvalidInput('entries', sorted(arrays), ', '.join(sorted(expected)))
    for name, shape in expected.items():
        array, kind = arrays[name], 'i' if name == 'generation' else 'f'
        missing = 0 in shape and name not in _OPTIONAL
        if array.shape != shape or array.dtype.kind != kind or missing:
            shown = f'{array.dtype} of shape {array.shape}'
            raise InvalidInput(name, shown, f'numbers of shape {shape}, none of them 0')
    for name, of_it in (('individuals', 'fitness'), ('population', 'population_fitness')):
        fitness = arrays[of_it]
        if not np.isfinite(arrays[name]).all():
            raise InvalidInput(name, 'not finite', 'finite numbers')
        if not (fitness[:-1] >= fitness[1:]).all() or np.isnan(fitness).any():
            raise InvalidInput(of_it, fitness.tolist(), 'numbers, the best first')
    spent = arrays['history'][:, 1]
    if not (np.diff(spent, prepend=0) > 0).all() or not spent[-1] <= config.episodes:
        raise InvalidInput('history', spent.tolist(), f'up to {config.episodes} episodes')
