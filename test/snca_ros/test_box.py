"""The controllers in the box load, walk, and stand beside the history that made them."""

import csv
from pathlib import Path

import pytest

from sim_node.simulation import Simulation
from snca_ros.box import DEFAULT_CONTROLLER, boxed_controllers, find_controller
from snca_ros.controller_file import load_controller
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.locomotion import run_episode

BOX = Path(__file__).resolve().parents[2] / 'config' / 'controllers'
NAMES = [path.stem for path in sorted(BOX.glob('*.npz'))]


def test_default_is_in_the_box():
    assert DEFAULT_CONTROLLER in NAMES
    assert find_controller(DEFAULT_CONTROLLER) == BOX / f'{DEFAULT_CONTROLLER}.npz'
    assert set(NAMES) <= set(boxed_controllers())


@pytest.mark.parametrize('name', NAMES)
def test_controller_is_what_its_history_says(name):
    trained = load_controller(BOX / f'{name}.npz')
    config = RunConfig.from_yaml(BOX / f'{name}.yaml')
    rows = list(csv.DictReader((BOX / f'{name}.csv').open()))
    assert trained.evaluations == config.evaluations == int(rows[-1]['evaluations']) >= 5000
    assert trained.fitness == float(rows[-1]['best_so_far'])
    assert (trained.architecture, trained.seed) == (config.architecture, config.seed)
    best = [float(row['best_so_far']) for row in rows]
    assert best == sorted(best)


@pytest.mark.parametrize('name', NAMES)
def test_controller_walks(name):
    trained = load_controller(BOX / f'{name}.npz')
    simulation = Simulation(
        trained.morphology, trained.terrain, material=trained.material, solver=trained.solver
    )
    # Another C library may end in another episode of the same gait: chaos, see the README.
    assert run_episode(simulation, trained.controller()).velocity() > 1.0
