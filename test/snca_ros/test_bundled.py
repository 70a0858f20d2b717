"""The bundled controllers load, walk, and are those of the campaign that made them."""

import csv
import re

import pytest
from support.made_up_results import PAPER_TYPES, made_up_row, write_results
from support.paths import ROOT

import snca_ros.bundled
from scripts import bundle_controllers
from sim_node.simulation import Simulation
from snca_ros.bundled import DEFAULT_CONTROLLER, bundled_controllers, find_controller
from snca_ros.controller_file import load_controller
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import run_episode
from snca_ros.evolution.history import read_history

BUNDLED, RESULTS = ROOT / 'config' / 'controllers', ROOT / 'results' / 'paper'
NAMES = [path.stem for path in sorted(BUNDLED.glob('*.npz'))]


def test_default_is_bundled():
    assert DEFAULT_CONTROLLER in NAMES
    assert find_controller(DEFAULT_CONTROLLER) == BUNDLED / f'{DEFAULT_CONTROLLER}.npz'
    assert set(NAMES) <= set(bundled_controllers())


@pytest.mark.parametrize('library', ['lib/python3.12/site-packages', 'local/lib/python', '.'])
def test_the_bundled_are_found_beside_an_installation(library, tmp_path, monkeypatch):
    """With `pip install --prefix`, `--user` and `--target`."""
    monkeypatch.setattr(snca_ros.bundled, '__file__', f'{tmp_path / library}/snca_ros/bundled.py')
    controllers = tmp_path / 'share' / 'snca_ros' / 'config' / 'controllers'
    controllers.mkdir(parents=True)
    (controllers / 'one-of-them.npz').touch()
    assert bundled_controllers()['one-of-them'] == controllers / 'one-of-them.npz'


def test_default_is_what_its_history_says():
    trained = load_controller(BUNDLED / f'{DEFAULT_CONTROLLER}.npz')
    config = RunConfig.from_yaml(BUNDLED / f'{DEFAULT_CONTROLLER}.yaml')
    history = read_history(BUNDLED / f'{DEFAULT_CONTROLLER}.csv')
    assert trained.evaluations == config.episodes == history.episodes
    assert (trained.architecture, trained.seed) == (config.architecture, config.seed)
    best = history.rows[:, -1].tolist()
    assert best == sorted(best)
    assert best[-1] >= trained.fitness  # the robust controller is not always the evolution's best


def test_table_of_the_bundled_is_that_of_the_campaign():
    """Of runs that are in the results now; later seeds may have more robust controllers."""
    runs = {row['run']: row for row in csv.DictReader((RESULTS / 'results.csv').open())}
    table = re.findall(
        r'^\| `(.+)` \| `(.+)` \| (.+) ± (.+) \| (.+) \|$',
        (BUNDLED / 'README.md').read_text(), re.MULTILINE,
    )
    assert [name for name, *_ in table] == sorted(NAMES, key=[t[0] for t in table].index)
    for name, run, *shown in table:
        original = RESULTS / 'controllers' / f'{run}-robust.npz'
        assert (BUNDLED / f'{name}.npz').read_bytes() == original.read_bytes()
        row = runs[run]
        assert name == f'{row["shape"]}-{row["architecture"]}-{row["neuron_model"]}'
        columns = 'v_x_robust_mean', 'v_x_robust_std', 'v_x_robust_unseen'
        assert shown == [f'{float(row[column]):.2f}' for column in columns]


def test_the_most_robust_controllers_are_bundled(tmp_path):
    rows = [
        made_up_row(shape, *of_type, seed, v_x_robust_mean=mean, v_x_robust_std=0.25,
                    v_x_robust_unseen=3.0, v_x_pushed_mean=9.0 - mean)
        for shape in ('biped', 'worm') for of_type in PAPER_TYPES
        for seed, mean in enumerate((4.0, 6.0, 5.0))
    ]
    results, box, runs = (tmp_path / name for name in ('results', 'box', 'runs'))
    write_results(results, [*rows, made_up_row('comb', 'U-nD', 'snn', v_x_robust_mean=99.0)])
    for folder in (results / 'controllers', box, runs):
        folder.mkdir()
    for row in rows:
        (results / 'controllers' / f'{row["run"]}-robust.npz').write_text(row['run'])
        (runs / row['run']).mkdir()
        for name in ('config.yaml', 'history.csv'):
            (runs / row['run'] / name).write_text(f'{name} of {row["run"]}')
    found = bundle_controllers.champions(results)
    bundle_controllers.fill(runs, found, box)
    names = [f'{shape}-{a}-{m}' for shape in ('biped', 'worm') for a, m in PAPER_TYPES]
    assert {p.name for p in box.iterdir()} == {
        *(f'{name}.npz' for name in names), 'README.md', f'{DEFAULT_CONTROLLER}.yaml',
        f'{DEFAULT_CONTROLLER}.csv',
    }
    for name in names:
        assert (box / f'{name}.npz').read_text() == f'{name}-flat-batched-reference-seed1'
    assert (box / f'{DEFAULT_CONTROLLER}.yaml').read_text().startswith('config.yaml of biped-U-nD')
    readme = (box / 'README.md').read_text()
    assert readme == bundle_controllers.readme(found)
    table = re.findall(r'^\| `(.+)` \| `(.+)` \| 6.00 ± 0.25 \| 3.00 \|$', readme, re.M)
    assert table == [(name, f'{name}-flat-batched-reference-seed1') for name in names]
    assert f'\n`{DEFAULT_CONTROLLER}` is what' in readme


@pytest.mark.parametrize('name', NAMES)
def test_controller_walks(name):
    trained = load_controller(BUNDLED / f'{name}.npz')
    simulation = Simulation(
        trained.morphology, trained.terrain, material=trained.material, solver=trained.solver
    )
    # Another C library may end in another episode of the same gait: chaos, see the README.
    assert run_episode(simulation, trained.controller()).velocity() > 1.0
