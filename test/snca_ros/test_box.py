"""The controllers in the box load, walk, and are those of the campaign that made them."""

import csv
import re
from pathlib import Path

import pytest

from sim_node.simulation import Simulation
from snca_ros.box import DEFAULT_CONTROLLER, boxed_controllers, find_controller
from snca_ros.controller_file import load_controller
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.locomotion import run_episode

ROOT = Path(__file__).resolve().parents[2]
BOX, RESULTS = ROOT / 'config' / 'controllers', ROOT / 'results' / 'paper'
NAMES = [path.stem for path in sorted(BOX.glob('*.npz'))]


def test_default_is_in_the_box():
    assert DEFAULT_CONTROLLER in NAMES
    assert find_controller(DEFAULT_CONTROLLER) == BOX / f'{DEFAULT_CONTROLLER}.npz'
    assert set(NAMES) <= set(boxed_controllers())


def test_default_is_what_its_history_says():
    trained = load_controller(BOX / f'{DEFAULT_CONTROLLER}.npz')
    config = RunConfig.from_yaml(BOX / f'{DEFAULT_CONTROLLER}.yaml')
    rows = list(csv.DictReader((BOX / f'{DEFAULT_CONTROLLER}.csv').open()))
    assert trained.evaluations == config.evaluations == int(rows[-1]['evaluations'])
    assert (trained.architecture, trained.seed) == (config.architecture, config.seed)
    best = [float(row['best_so_far']) for row in rows]
    assert best == sorted(best)
    assert best[-1] > 0.9 * trained.fitness  # another engine chose it among the best


def test_table_of_the_box_is_that_of_the_campaign():
    runs = {row['run']: row for row in csv.DictReader((RESULTS / 'results.csv').open())}
    table = re.findall(
        r'^\| `(.+)` \| `(.+)` \| (.+) \| (.+) ± (.+) \|$', (BOX / 'README.md').read_text(), re.M
    )
    assert [name for name, *_ in table] == sorted(NAMES, key=[t[0] for t in table].index)
    for name, run, *told in table:
        original = RESULTS / 'controllers' / f'{run}.npz'
        assert (BOX / f'{name}.npz').read_bytes() == original.read_bytes()
        row = runs[run]
        assert name == f'{row["shape"]}-{row["architecture"]}-{row["neuron_model"]}'
        columns = 'v_x', 'v_x_starts_mean', 'v_x_starts_std'
        assert told == [f'{float(row[column]):.2f}' for column in columns]
        case = 'shape', 'architecture', 'neuron_model', 'as_printed'
        rivals = [other for other in runs.values() if all(other[c] == row[c] for c in case)]
        assert row == max(rivals, key=lambda other: float(other['v_x_starts_mean']))


@pytest.mark.parametrize('name', NAMES)
def test_controller_walks(name):
    trained = load_controller(BOX / f'{name}.npz')
    simulation = Simulation(
        trained.morphology, trained.terrain, material=trained.material, solver=trained.solver
    )
    # Another C library may end in another episode of the same gait: chaos, see the README.
    assert run_episode(simulation, trained.controller()).velocity() > 1.0
