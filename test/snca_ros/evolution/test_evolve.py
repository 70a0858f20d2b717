"""`snca evolve` as a person runs it: what its folder holds, and that the same run repeats."""

import numpy as np
import pytest
import yaml
from support.evolve import EVALUATIONS, FILES, TASK, arrays_of, assert_same_run, evolve, history_of

from sim_node.simulation import Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import load_controller
from snca_ros.evolution.checkpoint_arrays import HISTORY
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.episode import run_episode


def test_run_folder_holds_what_it_should(whole):
    assert {p.name for p in whole.iterdir()} - {'.lock'} == FILES
    config = RunConfig.from_yaml(whole / 'config.yaml')
    assert config == RunConfig(
        'worm', Architecture.named('U-nD', 'snn-h'), episodes=EVALUATIONS, seed=3,
        population=8, duration=1.0, transient=0.2,
    )
    values = yaml.safe_load((whole / 'config.yaml').read_text())
    assert set(values) == set(RunConfig.__dataclass_fields__)


def test_history_has_a_row_a_generation_and_spends_the_evaluations_exactly(whole):
    rows = history_of(whole)
    assert tuple(rows[0]) == HISTORY
    assert [int(row['generation']) for row in rows] == list(range(29))
    spent = [int(row['episodes']) for row in rows]
    assert spent == [*range(8, 198, 7), EVALUATIONS]
    best = -np.inf
    for row in rows:
        worst, median, top = (float(row[name]) for name in ('worst', 'median', 'best'))
        assert worst <= median <= top
        best = max(best, top)
        assert float(row['best_so_far']) == best
    assert best > float(rows[0]['best'])  # it learns


def test_best_scores_again_what_the_history_says(whole):
    config = RunConfig.from_yaml(whole / 'config.yaml')
    trained = load_controller(whole / 'best.npz')
    assert trained.fitness == float(history_of(whole)[-1]['best_so_far'])
    assert (trained.seed, trained.evaluations, trained.terrain) == (3, EVALUATIONS, 'flat')
    assert trained.architecture == config.architecture
    assert trained.morphology.name == 'worm'
    simulation = Simulation(
        trained.morphology, trained.terrain, material=trained.material, solver=trained.solver
    )
    episode = run_episode(simulation, trained.controller(), config.duration)
    assert episode.velocity(config.transient) == trained.fitness


def test_checkpoint_is_the_best_first(whole):
    arrays, best = arrays_of(whole / 'checkpoint.npz'), load_controller(whole / 'best.npz')
    assert arrays['fitness'][0] == arrays['fitness'].max() == best.fitness
    np.testing.assert_array_equal(arrays['individuals'][0], best.parameters)
    assert arrays['individuals'].shape[1] == 500
    assert arrays['generation'] == 29
    # The last generation has 3 candidates: the population before it is kept.
    assert (len(arrays['individuals']), arrays['population'].shape) == (4, (8, 500))
    assert arrays['population_fitness'][0] == float(history_of(whole)[-2]['best_so_far'])
    assert arrays['other_engine'].tolist() == [best.scores['batched']]


def test_number_of_workers_does_not_matter(whole, tmp_path):
    folder = tmp_path / 'run'
    run = evolve(*TASK, '--episodes', EVALUATIONS, '--workers', 2, '--run', folder)
    assert run.returncode == 0, run.stderr
    assert_same_run(whole, folder)


@pytest.mark.parametrize('episodes', [3, 8])
def test_budget_within_the_first_generation_and_default_folder(whole, tmp_path, episodes):
    run = evolve(*TASK, '--episodes', episodes, '--workers', 1, cwd=tmp_path)
    assert run.returncode == 0, run.stderr
    settings = f'evaluations{episodes}-population8-duration1-transient0.2'
    name = f'worm-U-nD-snn-h-flat-reference-{settings}-seed3'
    folder = tmp_path / 'runs' / name
    assert {p.name for p in folder.iterdir()} - {'.lock'} == FILES
    rows = history_of(folder)
    assert [int(row['episodes']) for row in rows] == [episodes]
    if episodes == 8:
        assert rows[0] == history_of(whole)[0]


def test_diverging_physics_is_survived(tmp_path):
    folder = tmp_path / 'run'
    folder.mkdir()
    config = RunConfig('worm-2x1', Architecture.named('U-D', 'mlp'), episodes=7, population=4)
    values = yaml.safe_load(config.to_yaml())
    values |= {'duration': 5.1, 'material': {'frequency': 30.0, 'damping_ratio': 0.0}}
    values['solver']['physics'] = 'first'
    (folder / 'config.yaml').write_text(yaml.safe_dump(values))
    run = evolve('--resume', folder, '--workers', 1)
    assert run.returncode == 0, run.stderr
    assert 'Traceback' not in run.stderr
    assert 'Warning' not in run.stderr
    rows = history_of(folder)
    assert [int(row['episodes']) for row in rows] == [4, 7]
    assert {row['best_so_far'] for row in rows} == {'-inf'}
    assert load_controller(folder / 'best.npz').fitness == -np.inf
