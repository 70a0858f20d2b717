import math
import os
import subprocess
import sys

import numpy as np
import pymunk
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from support.limits import LIMIT
from support.paths import ROOT, TEST
from support.trace import trace

from sim_node.engine import ENGINES
from sim_node.errors import InvalidInput
from sim_node.model.material import Material
from sim_node.model.morphology import parse_morphology
from sim_node.model.solver import Solver
from sim_node.model.terrain import parse_terrain
from sim_node.munk2d.pymunk_view import pymunk_view
from sim_node.simulation import Diverged, Simulation

EXPLICIT = Solver(physics='first')
"""Explicit springs, which can diverge."""


def run(sim, seconds, actuation=0.0):
    for _ in range(round(60 * seconds)):
        readings = sim.step(np.full(sim.morphology.n_voxels, actuation))
    return readings


def rest_lengths(sim):
    constraints = pymunk_view(sim.backend.space).constraints
    springs = [c for c in constraints if isinstance(c, pymunk.DampedSpring)]
    return np.array([s.rest_length for s in springs])


def test_readings_at_the_reset():
    for shape in ('1', 'biped'):
        readings = Simulation(shape).reset()
        assert readings.shape == (parse_morphology(shape).n_voxels, 4)
        assert readings == pytest.approx(np.tile([0.5, 0.0, 0.5, 0.5], (len(readings), 1)))


def test_free_fall():
    sim = Simulation('worm')
    y, v = sim.center[1], 0.0
    for k in range(1, 21):
        sim.step(np.zeros(5))
        v = v * math.exp(-0.1 / 60) - 9.8 / 60
        y += v / 60
        assert sim.time == pytest.approx(k / 60)
        assert sim.center == pytest.approx((11 + 7.5, y))
        assert sim.velocity == pytest.approx((0.0, v), abs=1e-12)
    assert y == pytest.approx(7.5 - 0.5 * 9.8 / 9, abs=0.06)


def test_readings_in_free_fall():
    sim, speeds = Simulation('1'), [0.0]
    for _ in range(20):
        readings = sim.step(np.zeros(1))
        speeds.append(speeds[-1] * math.exp(-0.1 / 60) - 9.8 / 60)
        mean = np.mean(speeds[-30:])  # the reset is the first sample
        assert readings[0] == pytest.approx([0.5, 0.0, 0.5, math.tanh(mean / 4) / 2 + 0.5])


def test_substeps_divide_the_control_step():
    sim = Simulation('1', solver=Solver(substeps=4))
    assert sim.world.dt == pytest.approx(1 / 240)
    y, v = sim.center[1], 0.0
    for _ in range(10):
        sim.step(np.zeros(1))
        for _ in range(4):
            v = v * math.exp(-0.1 / 240) - 9.8 / 240
            y += v / 240
    assert sim.center[1] == pytest.approx(y)
    assert sim.time == pytest.approx(1 / 6)


def test_masses_are_read_in_the_order_of_the_body():
    sim = Simulation('comb', 'hilly-1-10-0')
    run(sim, 2.0, 0.3)
    masses = pymunk_view(sim.backend.space).bodies
    rows = [(*b.position, b.angle, *b.velocity) for b in masses]
    assert sim.world.masses.tolist() == [pytest.approx(row, abs=0.0) for row in rows]
    assert sim.center == pytest.approx(np.mean([b.position for b in masses], axis=0))
    assert sim.velocity == pytest.approx(np.mean([b.velocity for b in masses], axis=0))


def test_touch_of_a_landed_robot():
    sim = Simulation('biped')
    landed = 0
    for _ in range(60):
        touch = sim.step(np.zeros(10))[:, 1]
        landed += bool(sim.world.touching[0])
        assert touch[0] <= landed / 15 + 1e-12
        if landed == 1:
            assert 0.0 < touch[0] <= 1 / 15
        assert not touch[2:].any()  # the feet are voxels 0 and 1
    run(sim, 3.0)
    assert run(sim, 0.5)[:, 1].tolist() == [1.0, 1.0] + [0.0] * 8
    # The ramp of the mean over 15 steps, seen from the moment of the first contact:
    sim.reset()
    seen = [sim.step(np.zeros(10))[0, 1] for _ in range(60)]
    first = next(k for k, t in enumerate(seen) if t > 0)
    assert 0.4 < first / 60 < 0.5  # it falls 1 m
    assert seen[first] == pytest.approx(1 / 15)


@pytest.mark.parametrize('shape', ['1', 'biped'])
@pytest.mark.parametrize(('actuation', 'ratio'), [(1.0, 0.775), (-1.0, 1.225), (0.0, 1.0)])
def test_full_actuation_reaches_the_area_range(shape, actuation, ratio):
    sim = Simulation(shape)
    readings = run(sim, 5.0, actuation)
    assert sim.world.area_ratios == pytest.approx(ratio, rel=0.05)
    soft = [1 / (1 + math.exp(-8 * (area - 1))) for area in sim.world.area_ratios]
    assert readings[:, 0] == pytest.approx(soft)


def test_actuation_sets_the_rest_lengths_of_its_voxel_only():
    sim = Simulation('11')
    short, rest, long = sim.world.rest
    assert rest_lengths(sim) == pytest.approx(rest)
    for a, b in ((1.0, 0.0), (0.5, -0.5), (-1.0, 0.25), (0.0, -1.0), (0.0, 0.0)):
        sim.step([a, b])
        expected = []
        for i, value in enumerate((a, b)):
            own = slice(18 * i, 18 * i + 18)
            if value > 0:
                expected += list(rest[own] - (rest[own] - short[own]) * value)
            else:
                expected += list(rest[own] + (long[own] - rest[own]) * -value)
        assert rest_lengths(sim) == pytest.approx(np.array(expected), abs=1e-12)


@given(st.lists(st.floats(-1e300, 1e300), min_size=2, max_size=2))
@settings(max_examples=30)
def test_actuation_is_clipped(values):
    ends = []
    for actuation in (np.array(values), np.clip(values, -1.0, 1.0)):
        sim = Simulation('11')
        for _ in range(3):
            readings = sim.step(actuation)
        ends.append((readings.tobytes(), sim.world.masses.tobytes(), rest_lengths(sim).tobytes()))
    assert ends[0] == ends[1]


@pytest.mark.parametrize(
    'actuation',
    [
        np.zeros(9), np.zeros(11), np.zeros((1, 10)), np.zeros((10, 1)), [], 0.0,
        [*np.zeros(9), math.nan], [*np.zeros(9), math.inf], [-math.inf, *np.zeros(9)], None,
        [None] * 10,
        ['a'] * 10, [0.0, [1.0]], 'full', {},
    ],
)
def test_unusable_actuation_is_refused_and_changes_nothing(actuation):
    sim = Simulation('biped')
    run(sim, 0.2, 0.5)
    before = sim.world.masses.tobytes(), rest_lengths(sim).tobytes(), sim.step_count
    with pytest.raises(InvalidInput, match='actuation'):
        sim.step(actuation)
    assert (sim.world.masses.tobytes(), rest_lengths(sim).tobytes(), sim.step_count) == before


def test_lists_and_whole_numbers_are_actuation():
    assert Simulation('11').step([1, -1]).shape == (2, 4)


def test_runs_repeat_bit_for_bit():
    options = {'sensor_noise': 0.1, 'seed': 3}
    assert trace() == trace() != trace(terrain='hilly-1-10-1')
    assert trace(**options) == trace(**options) != trace()
    sim = Simulation('biped', **options)
    first = [sim.reset()] + [sim.step(np.ones(10)) for _ in range(50)]
    again = [sim.reset()] + [sim.step(np.ones(10)) for _ in range(50)]
    assert np.array(first).tobytes() == np.array(again).tobytes()


def test_a_fresh_process_gives_the_same_bits():
    code = 'from support.trace import trace; print(trace(sensor_noise=0.05, seed=1))'
    result = subprocess.run(
        [sys.executable, '-c', code], capture_output=True, text=True,
        check=True, timeout=LIMIT,
        env={**os.environ, 'PYTHONPATH': f'{ROOT}{os.pathsep}{TEST}', 'PYTHONHASHSEED': '7'},
    )
    assert result.stdout.strip() == trace(sensor_noise=0.05, seed=1)


def test_simulations_do_not_disturb_each_other():
    alone, beside, other = Simulation('biped'), Simulation('biped'), Simulation('comb', 'uphill-10')
    for k in range(120):
        a = np.sin(0.3 * k + np.arange(10))
        expected = alone.step(a)
        other.step(np.cos(0.5 * k) * np.ones(11))
        assert beside.step(a).tobytes() == expected.tobytes()


def test_readings_are_the_callers_own():
    sim = Simulation('1')
    first = sim.step([1.0])
    kept = first.copy()
    sim.step([-1.0])
    assert (first == kept).all()


def test_sensor_noise():
    quiet, noisy = Simulation('biped'), Simulation('biped', sensor_noise=0.01, seed=4)
    differences = [noisy.reset() - quiet.reset()]
    differences += [noisy.step(np.zeros(10)) - quiet.step(np.zeros(10)) for _ in range(200)]
    noise = np.array(differences)[:, :, [0, 2, 3]]  # touch is clipped at 0
    assert noise.std() == pytest.approx(0.01, rel=0.05)
    assert noise.mean() == pytest.approx(0.0, abs=4 * 0.01 / noise.size**0.5)
    assert noisy.world.masses.tobytes() == quiet.world.masses.tobytes()  # only readings are noisy
    expected = 0.01 * np.random.default_rng(4).standard_normal((1, 10, 4))[0]
    assert differences[0][:, [0, 2, 3]] == pytest.approx(expected[:, [0, 2, 3]], abs=1e-12)


def test_noisy_readings_stay_in_range_and_depend_on_the_seed():
    runs = {}
    for seed in (0, 1):
        sim = Simulation('biped', sensor_noise=1.0, seed=seed)
        runs[seed] = np.array([sim.reset()] + [sim.step(np.zeros(10)) for _ in range(20)])
        assert runs[seed].min() == 0.0
        assert runs[seed].max() == 1.0
    assert (runs[0] != runs[1]).any()


def test_noise_drawn_at_once_or_step_by_step_is_the_same():
    a, b = (Simulation('biped', sensor_noise=0.5, seed=9) for _ in range(2))
    many = a.disturbance(7).noise
    steps = np.concatenate([b.disturbance(n).noise for n in (1, 2, 4)])
    assert many.shape == (7, 10, 4)
    assert many.tobytes() == steps.tobytes()
    assert Simulation('biped').disturbance(7).noise.shape == (7, 0, 4)


def test_divergence_is_raised_and_never_returned():
    material = Material(frequency=30.0, damping_ratio=0.0)
    stiff = Simulation('biped', material=material, solver=EXPLICIT)
    rng = np.random.default_rng(0)

    def shake(steps):
        for _ in range(steps):
            assert np.isfinite(stiff.step(rng.choice([-1.0, 1.0], 10))).all()

    with pytest.raises(Diverged, match='biped: not finite at step'):
        shake(600)
    with pytest.raises(Diverged):
        stiff.step(np.zeros(10))
    assert np.isfinite(stiff.reset()).all()
    assert np.isfinite(stiff.step(np.zeros(10))).all()


@pytest.mark.parametrize('sensor_noise', [0.0, 0.1])
def test_one_bad_spring_is_a_divergence(sensor_noise):
    sim = Simulation('biped', sensor_noise=sensor_noise)
    sim.world.rest[0, 5] = math.nan
    with pytest.raises(Diverged, match=r'step [12]$'):
        run(sim, 0.05, 1.0)


def test_blow_up_is_a_divergence_even_while_finite():
    material = Material(frequency=12.0, damping_ratio=0.0)
    sim = Simulation('biped', material=material, solver=EXPLICIT)
    rng = np.random.default_rng(0)

    def shake(steps):
        for _ in range(steps):
            sim.step(rng.choice([-1.0, 1.0], 10))

    with pytest.raises(Diverged):
        shake(300)


@pytest.mark.parametrize('shape', ['biped', 'comb', 'worm', 'ball-5', 'box-2x2'])
def test_violent_actuation_stays_finite_and_untangles(shape):
    for period in (1, 3, 20):
        sim, rng = Simulation(shape), np.random.default_rng(period)
        for k in range(300):
            if k % period == 0:
                actuation = rng.choice([-1.0, 1.0], sim.morphology.n_voxels)
            readings = sim.step(actuation)
            assert 0.0 <= readings.min() <= readings.max() <= 1.0
            assert sim.world.area_ratios.min() > 0.3
            assert sim.world.area_ratios.max() < 2.0
        run(sim, 4.0)
        assert sim.world.area_ratios == pytest.approx(1.0, abs=0.3)


def test_a_dropped_robot_comes_to_rest_on_the_ground():
    for shape in ('biped', 'comb', 'worm'):
        sim = Simulation(shape)
        run(sim, 20.0)
        assert np.abs(sim.world.masses[:, 3:]).max() < 1e-3
        assert sim.world.corners[:, :, 1].min() == pytest.approx(5.0, abs=0.05)
        assert sim.center[0] == pytest.approx(11 + 1.5 * sim.morphology.width, abs=0.05)


@pytest.mark.parametrize('terrain', ['flat', 'hilly-1-10-0', 'steppy-1-20-0', 'downhill-20'])
def test_nothing_sinks_into_the_ground(terrain):
    sim = Simulation('biped', terrain)
    phase = np.arange(10)
    for k in range(900):
        sim.step(np.sin(0.3 * k - phase))
        x, y = sim.world.masses[:, :2].T
        assert (y > np.interp(x, sim.terrain.x, sim.terrain.y)).all()


def test_the_wall_holds_a_robot_back():
    tilted = parse_terrain('uphill-20')
    slippery = Simulation('1', tilted, material=Material(friction=0.0))
    run(slippery, 10.0)
    assert 9.0 < slippery.world.corners[0, :, 0].min() < 11.0


def test_friction_holds_on_a_slope():
    sticky, slippery = Simulation('worm', 'downhill-20'), Simulation(
        'worm', 'downhill-20', material=Material(friction=0.2)
    )
    run(sticky, 5.0)
    x = sticky.center[0]
    run(sticky, 5.0)
    assert sticky.center[0] == pytest.approx(x, abs=1e-3)
    run(slippery, 5.0)
    assert slippery.center[0] > x + 5.0


def test_names_and_numbers_are_checked():
    for arguments in (('bipet',), ('biped', 'flatt'), (None,), ('biped', 7)):
        with pytest.raises(InvalidInput):
            Simulation(*arguments)
    for noise in (-0.1, 11.0, math.nan, 'a', None):
        with pytest.raises(InvalidInput, match='sensor_noise'):
            Simulation('1', sensor_noise=noise)


@pytest.mark.parametrize('seed', [-1, 1.5, 'x', True])
def test_seeds_are_checked(seed):
    for name in ('seed', 'push'):
        with pytest.raises(InvalidInput, match=name):
            Simulation('1', **{name: seed})


@pytest.mark.parametrize('engine', ['pymunk', 'batched'])
def test_a_pushed_start_is_near_and_another_walk(engine):
    exact, *pushed = (Simulation('biped', engine=engine, push=seed) for seed in (0, 1, 2))
    at_rest = exact.world.masses.copy()
    for simulation in pushed:
        moved = simulation.world.masses - at_rest
        assert 0.9e-6 < np.abs(moved[:, :2]).max() <= 1.001e-6  # of 80 numbers, one is large
        assert not moved[:, 2:].any()
        areas = simulation.reset()[:, 0] - exact.reset()[:, 0]
        assert 0.0 < np.abs(areas).max() < 1e-5  # the sensors see it
    assert not np.array_equal(pushed[0].world.masses, pushed[1].world.masses)


def test_a_pushed_start_is_the_same_in_both_engines_and_after_a_reset():
    one, other = (Simulation('comb', 'hilly-1-10-0', engine=e, push=3) for e in ENGINES)
    start, readings = one.world.masses.copy(), one.readings.copy()
    assert np.array_equal(other.world.masses, start)
    np.testing.assert_allclose(other.readings, readings, rtol=0.0, atol=1e-12)
    for simulation in (one, other):
        before = simulation.readings.copy()
        run(simulation, 0.5, 1.0)
        assert np.array_equal(simulation.reset(), before)
        assert np.array_equal(simulation.world.masses, start)


def test_solver_is_checked():
    assert Solver() == Solver(1, 10, False, 'reference')
    assert Solver.from_dict({'iterations': 7}) == Solver(iterations=7, physics='first')
    for name, value in (
        ('substeps', 0), ('substeps', 101), ('substeps', 1.0), ('substeps', True),
        ('iterations', 0), ('iterations', '10'), ('self_collision', 1),
        ('self_collision', 'yes'), ('self_collision', None), ('physics', 'second'), ('physics', 1),
    ):
        with pytest.raises(InvalidInput, match=rf'solver\.{name}'):
            Solver(**{name: value})
    with pytest.raises(InvalidInput, match='solver'):
        Solver.from_dict({'iteration': 7})


def test_morphology_and_terrain_may_be_given_as_objects():
    a = Simulation(parse_morphology('biped'), parse_terrain('flat'))
    assert a.step(np.ones(10)).tobytes() == Simulation('biped').step(np.ones(10)).tobytes()


def test_touching_itself_is_no_touch():
    sim = Simulation('comb', material=Material(gravity=0.0), solver=Solver(self_collision=True))
    view = pymunk_view(sim.backend.space)
    for mass in view.bodies:
        mass.position += (50.0, 100.0)
    rng, met = np.random.default_rng(0), []
    for _ in range(30):
        actuation = rng.choice([-1.0, 1.0], 11)
        for _ in range(10):
            readings = sim.step(actuation)
            assert not readings[:, 1].any()
            for mass in view.bodies:
                mass.each_arbiter(lambda arbiter: met.append(arbiter.shapes))
    assert met
