"""The columns of results.csv: settings of a run, versions, and results of its assessment."""

from sim_node.errors import InvalidInput
from sim_node.model.sensors import DEFAULT_SENSORS
from sim_node.model.terrain import UNSEEN_KINDS
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode_set import EpisodeSet
from snca_ros.evolution.tasks import DEFAULT_TASK

OF_SET = ('faults', 'evolution_starts', 'draw', 'score')
"""Columns of a run's set of episodes besides shapes and terrains. `starts` is of the assessment."""

SETTINGS = (
    'run', 'shape', 'terrain', 'architecture', 'neuron_model', 'n_c', 'hidden', 'as_printed',
    'strategy', 'engine', 'physics', 'substeps', 'iterations', 'self_collision', 'population',
    'sigma', 'duration', 'transient', 'episodes', 'seed', *OF_SET,
)
"""Columns of a run's settings. They determine its name; settings are never parsed from a name."""

VERSIONS = ('code_version', 'numpy_version', 'numba_version', 'pymunk_version')
"""Columns of the versions that evolved and assessed a run, see `package_versions`."""

ROBUST = (
    'robust_rank', 'v_x_robust_chosen', 'robust_starts', 'v_x_robust_mean', 'v_x_robust_std',
    'v_x_robust_unseen',
)
"""Columns of the robust controller of a run."""

COLUMNS = (
    *SETTINGS, 'terrain_set', *VERSIONS,
    'chosen_by', 'v_x_end', 'v_x_other', 'starts', 'v_x_pushed_mean', 'v_x_pushed_std',
    'v_x_unseen', *UNSEEN_KINDS, *ROBUST, 'frequency', 'vibration',
)
"""The header of results.csv; docs/campaigns.md explains each column. Speeds are in [m/s]."""

FORMER_COLUMNS = tuple(
    {'episodes': 'evaluations'}.get(name, name) for name in COLUMNS if name not in OF_SET
)
"""The header of tables of earlier versions, in whose runs a candidate had one plain episode."""

TEXTS = (
    'run', 'shape', 'terrain', 'architecture', 'neuron_model', 'hidden', 'as_printed', 'strategy',
    'engine', 'physics', 'self_collision', 'terrain_set', *VERSIONS, 'chosen_by', 'starts',
    'robust_starts', 'faults', 'score',
)
"""Columns that hold no number."""

INTEGERS = (
    'n_c', 'substeps', 'iterations', 'population', 'episodes', 'seed', 'robust_rank',
    'evolution_starts', 'draw',
)
"""Columns that hold whole numbers."""

MAY_BE_EMPTY = (*VERSIONS, 'v_x_other', *ROBUST, 'vibration')
"""Columns that may be empty: the first tables lack them, or an engine cannot run the controller."""


def check_comparable(config: RunConfig) -> None:
    """Raise InvalidInput if results.csv has no columns for the task or the sensors of a run."""
    if config.architecture.sensors != DEFAULT_SENSORS:
        expected = f'{", ".join(DEFAULT_SENSORS)}: the results of a campaign name no sensors'
        raise InvalidInput('sensors', list(config.architecture.sensors), expected)
    if config.task != DEFAULT_TASK:
        expected = (
            f'{DEFAULT_TASK}, since the results of a campaign are speeds, v_x [m/s]; '
            f'`snca evolve` and `snca assess` take other tasks'
        )
        raise InvalidInput('task', config.task, expected)


def settings_of(config: RunConfig) -> dict[str, str]:
    """Return the values of the columns `SETTINGS` of a run, as text."""
    cell, solver = config.architecture, config.solver
    values = {
        'run': config.name,
        'shape': config.shape,
        'terrain': config.terrain,
        'architecture': cell.name,
        'neuron_model': cell.neuron_model,
        'n_c': cell.n_c,
        'hidden': 'x'.join(map(str, cell.hidden)) or '0',
        'as_printed': str(cell.as_printed).lower(),
        'strategy': config.strategy,
        'engine': config.engine,
        'physics': solver.physics,
        'substeps': solver.substeps,
        'iterations': solver.iterations,
        'self_collision': str(solver.self_collision).lower(),
        'population': config.population,
        'sigma': f'{config.sigma:.15g}',
        'duration': f'{config.duration:.15g}',
        'transient': f'{config.transient:.15g}',
        'episodes': config.episodes,
        'seed': config.seed,
        'faults': config.faults or 'none',
        'evolution_starts': config.starts,
        'draw': config.draw,
        'score': config.score,
    }
    return {name: str(values[name]) for name in SETTINGS}


def with_set(row: dict[str, str]) -> dict[str, str]:
    """Return a row under `FORMER_COLUMNS` with the present columns."""
    values = ('none', str(EpisodeSet.starts), str(EpisodeSet.draw), EpisodeSet.score)
    found = {**row, 'episodes': row['evaluations'], **dict(zip(OF_SET, values, strict=True))}
    return {column: found[column] for column in COLUMNS}


def unusual_cell(row: dict[str, str]) -> list[str]:
    """Return the sizes of a row's cells that are not defaults, such as ['n_c2', 'hidden16x8']."""
    usual = Architecture.named(row['architecture'], row['neuron_model'])
    n_c = int(row['n_c'])
    of_it = Architecture(usual.uniform, usual.directional, usual.neuron_model, n_c)
    found = [f'n_c{n_c}'] if n_c != usual.n_c else []
    if row['hidden'] != str(of_it.hidden[0]):
        found.append(f'hidden{row["hidden"]}')
    return found
