"""CMA-ES behind the ask/tell interface: it learns, depends on ranks alone, and can be resumed."""

import sys
from dataclasses import replace

import numpy as np
import pytest
from support.evolve import stopped_after

from sim_node.errors import InvalidInput
from snca_ros import cli
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import load_controller
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.strategies import CovarianceMatrixAdaptation, SimpleEvolutionStrategy
from snca_ros.evolution.workers import IN_PROCESS

pytest.importorskip('cma')

D = 6


def ellipsoid(x: np.ndarray) -> np.ndarray:
    """Return a fitness with its top, 0, at 0.5; a thousand times as steep in one direction."""
    return -((x - 0.5) ** 2 * np.logspace(0.0, 3.0, D)).sum(axis=1)


def go_on(strategy, generations, fitness=ellipsoid):
    for _ in range(generations):
        candidates = strategy.ask()
        strategy.tell(candidates, fitness(candidates))
    return strategy


def assert_same_state(one, other):
    assert one.keys() == other.keys()
    for name, array in one.items():
        assert array.tobytes() == other[name].tobytes(), name


def test_it_learns_what_the_simple_strategy_cannot():
    cma = go_on(CovarianceMatrixAdaptation(D, population=12), 150)
    assert cma.fitness[0] > -1e-8
    assert cma.fitness[0] == ellipsoid(cma.individuals[:1])[0]
    np.testing.assert_allclose(cma.individuals[0], 0.5, atol=1e-3)
    assert go_on(SimpleEvolutionStrategy(D, population=12), 150).fitness[0] < -1e-3


def test_individuals_are_the_best_so_far_and_the_newest_best_first():
    strategy, best = CovarianceMatrixAdaptation(D, population=8), []
    for _ in range(20):
        candidates = strategy.ask()
        fitness = ellipsoid(candidates)
        strategy.tell(candidates, fitness)
        assert strategy.fitness.tolist() == sorted([*best, *fitness], reverse=True)
        best = [max(*best, *fitness)]
        np.testing.assert_array_equal(ellipsoid(strategy.individuals), strategy.fitness)


@pytest.mark.parametrize('generations', [1, 2, 7])
def test_restored_strategy_goes_on_as_if_never_stopped(generations):
    whole = go_on(CovarianceMatrixAdaptation(D, seed=3), 12)
    begun = go_on(CovarianceMatrixAdaptation(D, seed=3), generations)
    restored = CovarianceMatrixAdaptation(D, seed=3)
    restored.restore(begun.state())
    assert_same_state(restored.state(), begun.state())
    assert_same_state(go_on(restored, 12 - generations).state(), whole.state())


def test_seeds_differ_and_the_global_random_state_does_not_matter():
    states = []
    for seed, noise in ((0, 1), (0, 2), (1, 1)):
        np.random.seed(noise)
        states.append(go_on(CovarianceMatrixAdaptation(D, seed=seed), 5).state())
    assert_same_state(states[0], states[1])
    assert not np.array_equal(states[0]['mean'], states[2]['mean'])


def test_only_ranks_matter_and_failures_are_the_last():
    def halved(x):
        fitness = ellipsoid(x)
        fitness[fitness < np.median(fitness)] = -np.inf
        return fitness

    plain = go_on(CovarianceMatrixAdaptation(D), 10)
    stretched = go_on(CovarianceMatrixAdaptation(D), 10, lambda x: np.exp(ellipsoid(x) / 1e3))
    assert np.array_equal(plain.state()['mean'], stretched.state()['mean'])
    failing = go_on(CovarianceMatrixAdaptation(D), 60, halved)
    assert np.isfinite(failing.state()['mean']).all()
    assert failing.fitness[0] > plain.fitness[0]
    hopeless = go_on(CovarianceMatrixAdaptation(D), 3, lambda x: np.full(len(x), -np.inf))
    assert np.isfinite(hopeless.ask()).all()


def test_state_of_another_history_is_refused():
    state = go_on(CovarianceMatrixAdaptation(D), 4).state()
    with pytest.raises(InvalidInput, match='mean'):
        CovarianceMatrixAdaptation(D).restore({**state, 'told': state['told'][:, ::-1]})


# --- runs -------------------------------------------------------------------------------------

CONFIG = RunConfig(
    'worm-3x1', Architecture.named('U-D', 'mlp'), engine='batched', strategy='cma',
    episodes=37, population=8, duration=1.0, transient=0.2,
)


def test_stopped_run_goes_on_to_the_same_end(tmp_path):
    folder = RunFolder.create(tmp_path / 'whole', CONFIG)
    progress = evolve(folder, IN_PROCESS)
    folder.close()
    assert [int(row[1]) for row in progress.history] == [8, 16, 24, 32, 37]
    individuals, fitness = progress.population
    assert (individuals.shape, len(fitness)) == ((8, CONFIG.n_parameters), 8)
    assert fitness[0] == progress.history[3][-1]
    folder = RunFolder.create(tmp_path / 'run', CONFIG)
    for episodes in (8, 24, 32):
        with pytest.raises(KeyboardInterrupt):
            evolve(folder, IN_PROCESS, stopped_after(episodes))
        folder.close()
        folder = RunFolder.resume(tmp_path / 'run')
    evolve(folder, IN_PROCESS)
    folder.close()
    for name in ('config.yaml', 'history.csv', 'best.npz', 'checkpoint.npz'):
        assert (tmp_path / 'run' / name).read_bytes() == (tmp_path / 'whole' / name).read_bytes()
    trained = load_controller(tmp_path / 'run' / 'best.npz')
    assert trained.scores['batched'] in progress.strategy['fitness']


@pytest.mark.parametrize('name', ['told', 'mean'])
def test_damaged_checkpoint_is_refused(tmp_path, name, capsys):
    folder = RunFolder.create(tmp_path / 'run', replace(CONFIG, engine='pymunk'))
    with pytest.raises(KeyboardInterrupt):
        evolve(folder, IN_PROCESS, stopped_after(16))
    folder.close()
    path = tmp_path / 'run' / 'checkpoint.npz'
    with np.load(path) as data:
        arrays = dict(data)
    for damage in (lambda a: a[:-1], lambda a: a + 1.0 if name == 'mean' else a[:, ::-1]):
        np.savez(path, **{**arrays, name: damage(arrays[name])})
        assert cli.main(['evolve', '--resume', str(tmp_path / 'run'), '--workers', '1']) == 2
        last = capsys.readouterr().err.splitlines()[-1]
        assert str(path) in last
        assert f': {name}: ' in last or ': mean: ' in last


def test_missing_package_is_one_line_and_no_folder(tmp_path, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, 'cma', None)
    run = ['--strategy', 'cma', '--run', str(tmp_path / 'run')]
    assert cli.main(['evolve', *run]) == 2
    err = capsys.readouterr().err
    assert err.count('\n') == 1
    assert "pip install 'snca_ros[cma]'" in err
    assert list(tmp_path.iterdir()) == []
    assert cli.main(['evolve', '--strategy', 'cmaes', '--run', str(tmp_path / 'run')]) == 2
    assert "did you mean 'cma'?" in capsys.readouterr().err
