"""Conversion of the first tables of results, whose rows lack settings, to the present columns.

Their runs have the first physics and the terrains that share the seed 0. Terrain, strategy and
further settings are missing in their columns and are parsed from the names of the runs, which
nothing else does. Columns whose values are not known are empty.
"""

import re
from typing import Any

from sim_node.errors import InvalidInput
from sim_node.model.physics import UNNAMED_PHYSICS
from sim_node.model.solver import Solver
from sim_node.model.terrain import FIRST_TERRAIN_SET, TERRAIN_SETS, UNSEEN_KINDS
from snca_ros.campaign.columns import COLUMNS, settings_of
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.strategies import STRATEGIES

FIRST_ENGINES = ('pymunk', 'batched')
"""The engines of the first results."""

FIRST_COLUMNS = (
    'run', 'shape', 'architecture', 'neuron_model', 'as_printed', 'seed', 'engine',
    'n_evaluations', 'v_x', 'chosen_by', *(f'v_x_{engine}' for engine in FIRST_ENGINES),
    'v_x_unseen', *TERRAIN_SETS[FIRST_TERRAIN_SET], 'starts', 'v_x_starts_mean', 'v_x_starts_std',
    'frequency',
)
"""The header of the first tables."""

FIRST_TEXTS = ('run', 'shape', 'architecture', 'neuron_model', 'as_printed', 'engine', 'chosen_by')
FIRST_INTEGERS = ('seed', 'n_evaluations', 'starts')

_WORD = re.compile(r'(?:hilly|steppy|uphill|downhill)(?:-\d[\d.]*)+|(?:[^-]|(?<=\de)-)+')
"""A word of a run's name: a terrain with its numbers, or text up to a hyphen (not that of 1e-5)."""

_NUMBERS = {
    'evaluations': int, 'population': int, 'sigma': float, 'duration': float, 'transient': float,
}


def converted(row: dict[str, str]) -> dict[str, str]:
    """Return a row of the first tables with the present columns.

    Its speeds are those of the controller in the run's best.npz, which in batched runs was chosen
    by pymunk among the best quarter: `v_x_end` is its episode in the run's engine.

    Raises:
        InvalidInput: the name of the run and the rest of the row do not agree.
    """
    config = _config(row)
    found = {
        **settings_of(config),
        'terrain_set': FIRST_TERRAIN_SET,
        'chosen_by': row['chosen_by'],
        'v_x_end': row[f'v_x_{config.engine}'],
        'v_x_other': row[f'v_x_{config.other_engine}'],
        'starts': f'1-{row["starts"]}',
        'v_x_pushed_mean': row['v_x_starts_mean'],
        'v_x_pushed_std': row['v_x_starts_std'],
        'v_x_unseen': row['v_x_unseen'],
        'frequency': row['frequency'],
    }
    terrains = zip(UNSEEN_KINDS, TERRAIN_SETS[FIRST_TERRAIN_SET], strict=True)
    found |= {kind: row[terrain] for kind, terrain in terrains}
    return {column: found.get(column, '') for column in COLUMNS}


def _config(row: dict[str, str]) -> RunConfig:
    """Return the configuration of a row, from its columns and the name of its run."""
    name, printed = row['run'], row['as_printed'] == 'true'
    case = f'{row["shape"]}-{row["architecture"]}-{row["neuron_model"]}-{"as-printed-" * printed}'
    seed = f'-seed{row["seed"]}'
    if not (name.startswith(case) and name.endswith(seed)):
        raise InvalidInput('run', name, f'{case}...{seed}, the name for the rest of its row')
    options: dict[str, Any] = {}
    for word in _WORD.findall(name[len(case) : -len(seed)]):
        key = next((key for key in _NUMBERS if word.startswith(key)), None)
        if key:
            options[{'evaluations': 'episodes'}.get(key, key)] = _number(key, word, name)
        elif word in STRATEGIES:
            options['strategy'] = word
        elif word not in FIRST_ENGINES:
            options['terrain'] = word
    cell = Architecture.named(row['architecture'], row['neuron_model'], as_printed=printed)
    config = RunConfig(
        row['shape'], cell, seed=int(row['seed']), engine=row['engine'],
        solver=Solver(physics=UNNAMED_PHYSICS), **options,
    )
    if config.name != name or config.episodes != int(row['n_evaluations']):
        named = f'{config.name} with {config.episodes} evaluations'
        raise InvalidInput('run', name, f'the name for the rest of its row, {named}')
    return config


def _number(key: str, word: str, name: str) -> float:
    try:
        return _NUMBERS[key](word.removeprefix(key))
    except ValueError:
        raise InvalidInput('run', name, f'a number after {key}') from None
