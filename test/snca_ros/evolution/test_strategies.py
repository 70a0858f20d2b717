"""The evolution strategy against a second computation of its generations with plain numpy."""

import io

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.evolve import stopped_after

from sim_node.errors import InvalidInput
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.strategies import STRATEGIES, SimpleEvolutionStrategy
from snca_ros.evolution.strategies.strategy import best_first
from snca_ros.evolution.workers import IN_PROCESS

D = 6

quick = settings(max_examples=50)


def score(x: np.ndarray) -> np.ndarray:
    """Return a fitness with one top, at 0.5 everywhere."""
    return -np.abs(np.asarray(x) - 0.5).sum(axis=1)


def go_on(strategy, generations, fitness=score):
    for _ in range(generations):
        candidates = strategy.ask()
        strategy.tell(candidates, fitness(candidates))
    return strategy


def test_one_generation_computed_anew():
    seed, population, sigma = 11, 36, 0.35
    strategy = SimpleEvolutionStrategy(D, seed=seed)

    first = strategy.ask()
    assert first.shape == (36, D)
    expected = np.random.default_rng([seed, 0]).uniform(-1.0, 1.0, (population, D))
    np.testing.assert_array_equal(first, expected)
    fitness = score(first)
    strategy.tell(first, fitness)

    ranked = sorted(range(population), key=lambda i: fitness[i], reverse=True)
    mean = sum(first[i] for i in ranked[:9]) / 9
    noise = np.random.default_rng([seed, 1]).normal(0.0, 1.0, (population - 1, D))
    children = strategy.ask()
    assert children.shape == (35, D)
    np.testing.assert_allclose(children, mean + sigma * noise, rtol=0, atol=1e-15)

    # The next parents: the best 9 of the 35 children and the old best, which keeps its fitness.
    child_fitness = score(children)
    strategy.tell(children, child_fitness)
    everybody = [(fitness[ranked[0]], first[ranked[0]])]
    everybody += list(zip(child_fitness, children, strict=True))
    everybody.sort(key=lambda pair: pair[0], reverse=True)
    np.testing.assert_array_equal(strategy.fitness, [f for f, _ in everybody])
    np.testing.assert_array_equal(strategy.individuals, [x for _, x in everybody])
    mean = sum(x for _, x in everybody[:9]) / 9
    noise = np.random.default_rng([seed, 2]).normal(0.0, 1.0, (population - 1, D))
    np.testing.assert_allclose(strategy.ask(), mean + sigma * noise, rtol=0, atol=1e-15)


def test_first_generation_is_uniform_on_minus_one_to_one():
    first = SimpleEvolutionStrategy(500, seed=1).ask()
    assert -1.0 <= first.min() < -0.99
    assert 0.99 < first.max() <= 1.0
    histogram = np.histogram(first, bins=10, range=(-1, 1))[0] / first.size
    np.testing.assert_allclose(histogram, 0.1, atol=0.012)  # 5 standard deviations


@pytest.mark.parametrize('sigma', [0.35, 2.0])
def test_children_are_normal_around_the_mean_of_the_best_quarter(sigma):
    strategy = SimpleEvolutionStrategy(500, sigma=sigma, seed=2)
    first = strategy.ask()
    fitness = score(first)
    strategy.tell(first, fitness)
    mean = first[np.argpartition(fitness, -9)[-9:]].mean(axis=0)
    z = (strategy.ask() - mean) / sigma
    assert abs(z.mean()) < 5 / np.sqrt(z.size)
    assert z.std() == pytest.approx(1.0, abs=5 / np.sqrt(2 * z.size))
    assert np.mean(np.abs(z) < 1) == pytest.approx(0.6827, abs=0.02)
    assert np.mean(np.abs(z) < 2) == pytest.approx(0.9545, abs=0.01)
    # Each child and each element has noise of its own.
    assert len(np.unique(z)) == z.size


@pytest.mark.parametrize(
    ('population', 'n_parents'), [(4, 1), (7, 1), (8, 2), (35, 8), (36, 9), (100, 25)]
)
def test_sizes_and_parents_of_any_population(population, n_parents):
    strategy = SimpleEvolutionStrategy(D, population=population, sigma=0.0)
    first = strategy.ask()
    assert first.shape == (population, D)
    fitness = score(first)
    strategy.tell(first, fitness)
    children = strategy.ask()
    assert children.shape == (population - 1, D)
    mean = first[np.argsort(-fitness)[:n_parents]].mean(axis=0)
    np.testing.assert_allclose(children, np.tile(mean, (population - 1, 1)), atol=1e-15)
    strategy.tell(children, score(children))
    assert strategy.individuals.shape == (population, D)


def test_best_is_kept_and_not_evaluated_again():
    strategy = SimpleEvolutionStrategy(D, seed=3)
    first = strategy.ask()
    fitness = np.arange(36.0)
    fitness[17] = 1000.0
    strategy.tell(first, fitness)
    for _ in range(5):
        candidates = strategy.ask()
        assert not (candidates == first[17]).all(axis=1).any()
        strategy.tell(candidates, np.full(35, 5.0))
        np.testing.assert_array_equal(strategy.best, first[17])
        assert strategy.fitness[0] == 1000.0
        assert (strategy.individuals == first[17]).all(axis=1).sum() == 1


def test_old_best_gives_way_to_a_better_one_and_dies_with_its_generation():
    strategy = SimpleEvolutionStrategy(D, seed=3)
    first = strategy.ask()
    strategy.tell(first, np.arange(36.0))
    children = strategy.ask()
    strategy.tell(children, np.where(np.arange(35) == 4, 36.0, 0.0))
    np.testing.assert_array_equal(strategy.best, children[4])
    np.testing.assert_array_equal(strategy.individuals[1], first[35])
    grandchildren = strategy.ask()
    strategy.tell(grandchildren, np.zeros(35))
    np.testing.assert_array_equal(strategy.best, children[4])
    assert not (strategy.individuals == first[35]).all(axis=1).any()


def test_of_equals_the_older_stays():
    strategy = SimpleEvolutionStrategy(D, seed=4)
    first = strategy.ask()
    strategy.tell(first, np.zeros(36))
    np.testing.assert_array_equal(strategy.individuals, first)
    strategy.tell(strategy.ask(), np.zeros(35))
    np.testing.assert_array_equal(strategy.best, first[0])


def test_equals_keep_their_order():
    strategy = SimpleEvolutionStrategy(D, population=400, seed=4)
    first = strategy.ask()
    fitness = np.arange(400) % 3
    strategy.tell(first, fitness.astype(float))
    expected = np.concatenate([first[fitness == level] for level in (2, 1, 0)])
    np.testing.assert_array_equal(strategy.individuals, expected)


def test_best_never_gets_worse_and_the_top_is_found():
    strategy, best = SimpleEvolutionStrategy(D, seed=5, sigma=0.1), []
    for _ in range(40):
        go_on(strategy, 1)
        best.append(strategy.fitness[0])
    assert best == sorted(best)
    assert np.abs(strategy.best - 0.5).max() < 0.25


# --- failed evaluations -----------------------------------------------------------------------


def test_failed_ones_are_no_parents():
    strategy = SimpleEvolutionStrategy(D, seed=6, sigma=0.0)
    first = strategy.ask()
    fitness = np.full(36, -np.inf)
    good = [3, 5, 8, 13, 21, 22, 23, 24, 35]
    fitness[good] = -np.arange(9.0) - 1e300
    strategy.tell(first, fitness)
    np.testing.assert_allclose(strategy.ask()[0], first[good].mean(axis=0), atol=1e-15)
    assert np.all(np.isneginf(strategy.fitness[9:]))
    assert np.all(np.isfinite(strategy.fitness[:9]))


def test_all_failed_goes_on():
    strategy = SimpleEvolutionStrategy(D, seed=7)
    strategy.tell(strategy.ask(), np.full(36, -np.inf))
    children = strategy.ask()
    assert np.isfinite(children).all()
    fitness = np.full(35, -np.inf)
    fitness[20] = -5.0
    strategy.tell(children, fitness)
    np.testing.assert_array_equal(strategy.best, children[20])
    assert np.isfinite(strategy.ask()).all()


def test_part_of_a_generation_is_taken():
    strategy = SimpleEvolutionStrategy(D, seed=8)
    go_on(strategy, 2)
    best = strategy.best.copy()
    candidates = strategy.ask()[:4]
    strategy.tell(candidates, np.full(4, -1e9))
    assert strategy.individuals.shape == (5, D)
    np.testing.assert_array_equal(strategy.individuals, [best, *candidates])


# --- seeds, restoring -------------------------------------------------------------------------


@pytest.mark.parametrize('seed', [0, 1, 2**31, 2**63 - 1])
def test_same_seed_same_candidates(seed):
    one, two = (SimpleEvolutionStrategy(D, seed=seed) for _ in range(2))
    for _ in range(4):
        candidates = one.ask()
        np.testing.assert_array_equal(candidates, two.ask())
        for strategy in (one, two):
            strategy.tell(candidates, score(candidates))
    np.testing.assert_array_equal(one.individuals, two.individuals)


def test_another_seed_other_candidates():
    firsts = [SimpleEvolutionStrategy(D, seed=seed).ask() for seed in range(20)]
    assert len(np.unique(firsts)) == 20 * 36 * D


def test_each_generation_has_noise_of_its_own():
    strategy = SimpleEvolutionStrategy(D, seed=9)
    noise = []
    for _ in range(5):
        candidates = strategy.ask()
        strategy.tell(candidates, score(candidates))
        noise.append(candidates[0] - candidates[1])
    assert len(np.unique(noise)) == 5 * D


def test_asking_twice_changes_nothing():
    # What was asked but not told, because the run was stopped, is asked again after it.
    strategy = go_on(SimpleEvolutionStrategy(D, seed=10), 3)
    np.testing.assert_array_equal(strategy.ask(), strategy.ask())


@pytest.mark.parametrize('fitness', [score, lambda x: np.full(len(x), -np.inf)])
@pytest.mark.parametrize('generations', [0, 1, 2, 7])
def test_restoring_equals_going_on(generations, fitness):
    strategy = go_on(SimpleEvolutionStrategy(D, seed=12), generations, fitness)
    file = io.BytesIO()
    np.savez(file, **strategy.state())
    go_on(strategy, 3, fitness)  # does not touch what was saved

    file.seek(0)
    with np.load(file, allow_pickle=False) as data:
        state = {name: data[name] for name in data.files}
    other = SimpleEvolutionStrategy(D, seed=12)
    other.restore(state)
    assert other.generation == generations
    go_on(other, 3, fitness)
    for name, array in strategy.state().items():
        np.testing.assert_array_equal(other.state()[name], array)
    np.testing.assert_array_equal(other.ask(), strategy.ask())


def test_state_is_not_changed_by_going_on():
    strategy = go_on(SimpleEvolutionStrategy(D, seed=13), 2)
    state = strategy.state()
    copy = {name: array.copy() for name, array in state.items()}
    go_on(strategy, 2)
    for name, array in copy.items():
        np.testing.assert_array_equal(state[name], array)


@quick
@given(
    population=st.integers(4, 50),
    seed=st.integers(0, 2**63 - 1),
    data=st.data(),
)
def test_population_is_sorted_and_of_its_size(population, seed, data):
    strategy = SimpleEvolutionStrategy(3, population=population, seed=seed)
    value = st.floats(-1e300, 1e300) | st.just(-np.inf)
    best = -np.inf
    for generation in range(3):
        candidates = strategy.ask()
        n = len(candidates)
        assert n == population - (generation > 0)
        assert np.isfinite(candidates).all()
        fitness = np.array(data.draw(st.lists(value, min_size=n, max_size=n)))
        strategy.tell(candidates, fitness)
        best = max(best, fitness.max())
        assert strategy.individuals.shape == (population, 3)
        assert strategy.fitness[0] == best
        assert np.all(strategy.fitness[:-1] >= strategy.fitness[1:])
        assert strategy.generation == generation + 1


class RandomSearch:
    """A strategy from outside the tree: it draws anew and keeps the best."""

    def __init__(self, n_parameters, *, population=36, sigma=0.35, seed=0):
        self.shape, self.sigma, self.seed = (population, n_parameters), sigma, seed
        self.individuals, self.fitness = np.empty((0, n_parameters)), np.empty(0)
        self.generation, self.drawn = 0, np.zeros(1)

    def ask(self):
        rng = np.random.default_rng([self.seed, self.generation])
        return self.sigma * rng.standard_normal(self.shape)

    def tell(self, candidates, fitness):
        self.individuals, self.fitness = best_first(self, candidates, fitness)
        self.individuals, self.fitness = self.individuals[:4], self.fitness[:4]
        self.generation += 1
        self.drawn += len(candidates)

    def state(self):
        return {'individuals': self.individuals, 'fitness': self.fitness, 'drawn': self.drawn,
                'generation': np.array(self.generation)}

    def restore(self, state):
        self.individuals, self.fitness = state['individuals'], state['fitness']
        self.generation, self.drawn = int(state['generation']), state['drawn']

    @staticmethod
    def own_state(n_parameters, population, generation):
        return {'drawn': (1,)}


def test_a_strategy_from_outside_the_tree_runs_and_resumes(tmp_path, monkeypatch):
    monkeypatch.setitem(STRATEGIES, 'random', RandomSearch)
    STRATEGIES.register('random', RandomSearch)
    with pytest.raises(InvalidInput, match='a name that is not taken'):
        STRATEGIES.register('random', SimpleEvolutionStrategy)
    whole = RunConfig(
        'worm-2x1', Architecture.named('U-D', 'mlp'), strategy='random', population=4,
        episodes=12, duration=0.5, transient=0.0,
    )
    once = RunFolder.create(tmp_path / 'once', whole)
    expected = evolve(once, IN_PROCESS)
    once.close()
    begun = RunFolder.create(tmp_path / 'twice', whole)
    with pytest.raises(KeyboardInterrupt):
        evolve(begun, IN_PROCESS, stopped_after(8))
    begun.close()
    resumed = RunFolder.resume(tmp_path / 'twice')
    found = evolve(resumed, IN_PROCESS)
    resumed.close()
    assert found.strategy['drawn'] == expected.strategy['drawn'] == 12.0
    np.testing.assert_array_equal(found.strategy['fitness'], expected.strategy['fitness'])
    assert [row[-1] for row in found.history] == [row[-1] for row in expected.history]
