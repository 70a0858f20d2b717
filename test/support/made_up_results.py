"""Results folders with made-up numbers, in the format of real ones."""

import csv
from pathlib import Path

import numpy as np

from sim_node.model.solver import Solver
from sim_node.model.terrain import TERRAIN_SETS, UNSEEN_KINDS
from snca_ros.campaign.columns import COLUMNS, settings_of
from snca_ros.campaign.first_results import FIRST_COLUMNS
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.config import RunConfig

PAPER_TYPES = (('U-nD', 'snn-h'), ('U-D', 'mlp'), ('nU-D', 'mlp'))


def made_up_run(
    shape='biped', architecture='U-nD', neuron_model='snn-h', seed=0, episodes=30_000,
    as_printed=False, engine='batched', physics='reference', **settings,
) -> RunConfig:
    """Return a run; `settings` are those of `RunConfig`."""
    cell = Architecture.named(architecture, neuron_model, as_printed=as_printed)
    return RunConfig(
        shape, cell, seed=seed, episodes=episodes, engine=engine,
        solver=Solver(physics=physics), **settings,
    )


def made_up_row(
    shape='biped', architecture='U-nD', neuron_model='snn-h', seed=0, episodes=30_000,
    as_printed=False, engine='batched', settings=None, **numbers,
) -> dict[str, str]:
    """Return a row of results.csv: more `settings` of the run, `numbers` for made-up ones."""
    config = made_up_run(
        shape, architecture, neuron_model, seed, episodes, as_printed, engine, **settings or {}
    )
    rng = np.random.default_rng([seed, *f'{shape} {architecture} {neuron_model}'.encode()])
    v_x = float(rng.uniform(2.0, 9.0))
    row = {
        **settings_of(config), 'terrain_set': 'seeds-1-12', 'code_version': '0123456789ab',
        'numpy_version': '2.0', 'numba_version': '0.60', 'pymunk_version': '7.0',
        'chosen_by': engine, 'v_x_end': v_x, 'v_x_other': v_x * rng.uniform(0.3, 1.0),
        'starts': '1-20', 'v_x_pushed_mean': v_x * rng.uniform(0.4, 0.9), 'v_x_pushed_std': 0.3,
        'v_x_unseen': v_x * rng.uniform(0.2, 0.8), **dict.fromkeys(UNSEEN_KINDS, 1.0),
        'robust_rank': 3, 'v_x_robust_chosen': v_x * rng.uniform(0.7, 0.9),
        'robust_starts': '101-120', 'v_x_robust_mean': v_x * rng.uniform(0.6, 0.9),
        'v_x_robust_std': 0.2, 'v_x_robust_unseen': v_x * rng.uniform(0.3, 0.8),
        'frequency': rng.uniform(0.5, 12.0), 'vibration': rng.uniform(0.0, 1.0), **numbers,
    }
    assert set(row) == set(COLUMNS)
    return {column: str(row[column]) for column in COLUMNS}


def first_row(*of_run, settings=None, chosen_by='pymunk', **numbers) -> dict[str, str]:
    """Return a row of one of the first tables, of the run that `made_up_run` makes of `of_run`."""
    config = made_up_run(*of_run, **{'physics': 'first', **(settings or {})})
    cell = config.architecture
    row = {
        'run': config.name, 'shape': config.shape, 'architecture': cell.name,
        'neuron_model': cell.neuron_model, 'as_printed': str(cell.as_printed).lower(),
        'seed': config.seed, 'engine': config.engine, 'n_evaluations': config.episodes,
        'v_x': 5.0, 'chosen_by': chosen_by, 'v_x_pymunk': 5.0, 'v_x_batched': 6.0,
        'v_x_unseen': 3.0, **{name: i for i, name in enumerate(TERRAIN_SETS['seed-0'])},
        'starts': 20, 'v_x_starts_mean': 4.0, 'v_x_starts_std': 0.5, 'frequency': 2.5, **numbers,
    }
    return {column: str(row[column]) for column in FIRST_COLUMNS}


def write_results(folder: Path, rows: list[dict[str, str]]) -> Path:
    """Write a results folder: the table, and for each run a history that ends at its v_x."""
    (folder / 'histories').mkdir(parents=True)
    with (folder / 'results.csv').open('w', newline='') as file:
        writer = csv.DictWriter(file, list(rows[0]) if rows else COLUMNS, lineterminator='\n')
        writer.writeheader()
        writer.writerows(rows)
    for row in rows:
        end = int(row['episodes'] if 'episodes' in row else row['n_evaluations'])
        v_x = max(float(row['v_x_end'] if 'v_x_end' in row else row['v_x_batched']), 0.0)
        seed = int(row['seed'])
        points = [(36, 0.1 * v_x), (71 + 35 * seed, 0.6 * v_x), (end // 2, 0.9 * v_x), (end, v_x)]
        lines = [f'{n},{v!r}' for n, v in points]
        text = '\n'.join(['episodes,best_so_far', *lines, ''])
        (folder / 'histories' / f'{row["run"]}.csv').write_text(text)
    return folder


def paper_rows(n_seeds: int, shapes=('biped', 'comb', 'worm')) -> list[dict[str, str]]:
    """Return the rows of a campaign like the paper's main one."""
    return [
        made_up_row(shape, *of_type, seed)
        for shape in shapes for of_type in PAPER_TYPES for seed in range(n_seeds)
    ]
