"""Results folders with made-up numbers, in the format of real ones."""

import csv
from pathlib import Path

import numpy as np

from sim_node.terrain import UNSEEN_TERRAINS
from snca_ros.study.results import COLUMNS

PAPER_TYPES = (('U-nD', 'snn-h'), ('U-D', 'mlp'), ('nU-D', 'mlp'))


def made_up_row(
    shape='biped', architecture='U-nD', neuron_model='snn-h', seed=0, evaluations=30_000,
    settings='flat-batched', as_printed=False, **numbers,
) -> dict[str, str]:
    """Return a row of results.csv; `numbers` replace made-up ones."""
    printed = 'as-printed-' if as_printed else ''
    if 'v_x' in numbers:
        numbers.setdefault('v_x_batched', numbers['v_x'])
    budget = '' if evaluations == 30_000 else f'-evaluations{evaluations}'
    rng = np.random.default_rng([seed, *f'{shape} {architecture} {neuron_model}'.encode()])
    v_x = float(rng.uniform(2.0, 9.0))
    row = {
        'run': f'{shape}-{architecture}-{neuron_model}-{printed}{settings}{budget}-seed{seed}',
        'shape': shape, 'architecture': architecture, 'neuron_model': neuron_model,
        'as_printed': str(as_printed).lower(), 'seed': seed, 'engine': 'batched',
        'n_evaluations': evaluations, 'v_x': v_x, 'chosen_by': 'batched', 'v_x_batched': v_x,
        'v_x_pymunk': v_x * rng.uniform(0.3, 1.0), 'v_x_unseen': v_x * rng.uniform(0.2, 0.8),
        'starts': 20, 'v_x_starts_mean': v_x * rng.uniform(0.4, 0.9), 'v_x_starts_std': 0.3,
        'frequency': rng.uniform(0.5, 12.0), **dict.fromkeys(UNSEEN_TERRAINS, 1.0), **numbers,
    }
    return {column: str(row[column]) for column in COLUMNS}


def write_results(folder: Path, rows: list[dict[str, str]]) -> Path:
    """Write a results folder: the table, and for each run a history that ends at its v_x."""
    (folder / 'histories').mkdir(parents=True)
    with (folder / 'results.csv').open('w', newline='') as file:
        writer = csv.DictWriter(file, COLUMNS, lineterminator='\n')
        writer.writeheader()
        writer.writerows(rows)
    for row in rows:
        end, v_x = int(row['n_evaluations']), max(float(row['v_x']), 0.0)
        seed = int(row['seed'])
        points = [(36, 0.1 * v_x), (71 + 35 * seed, 0.6 * v_x), (end // 2, 0.9 * v_x), (end, v_x)]
        lines = [f'{n},{v!r}' for n, v in points]
        text = '\n'.join(['evaluations,best_so_far', *lines, ''])
        (folder / 'histories' / f'{row["run"]}.csv').write_text(text)
    return folder


def paper_rows(n_seeds: int, shapes=('biped', 'comb', 'worm')) -> list[dict[str, str]]:
    """Return the rows of a campaign like the paper's main one."""
    return [
        made_up_row(shape, *of_type, seed)
        for shape in shapes for of_type in PAPER_TYPES for seed in range(n_seeds)
    ]
