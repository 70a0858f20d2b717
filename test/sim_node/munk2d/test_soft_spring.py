"""Springs of the reference physics, compared with closed forms and an independent integrator."""

import math

import numpy as np
import pymunk
import pytest
from pymunk._chipmunk import lib

from sim_node.model.body import SPRING, Body, Constraints, build_body
from sim_node.model.material import Material
from sim_node.model.morphology import parse_morphology
from sim_node.model.solver import Solver
from sim_node.model.terrain import parse_terrain
from sim_node.munk2d import soft_spring
from sim_node.munk2d.pymunk_view import pymunk_view
from sim_node.munk2d.soft_spring import SPRING as SPRING_STRUCT
from sim_node.munk2d.space import Space
from sim_node.simulation import Simulation

STILL = Material(gravity=0.0, damping=0.0)
FLAT = parse_terrain('flat')


def row_of_masses(stiffness, damping, extensions, iterations):
    """Return masses joined in a row by springs of length 3, and a function that makes a step."""
    n = len(extensions)
    x = 100.0 + np.concatenate([[0.0], np.cumsum(3.0 + np.array(extensions))])
    table = Constraints(
        np.full(n, SPRING), np.column_stack([np.arange(n), np.arange(1, n + 1)]),
        np.zeros((n, 4)), np.full(n, 3.0), np.full(n, stiffness), np.full(n, damping),
    )
    body = Body(np.column_stack([x, np.full(n + 1, 100.0)]), table, np.full((3, n), 3.0))
    view = pymunk_view(Space(body, FLAT.polygons, STILL, Solver(iterations=iterations)))
    masses = list(view.bodies)

    def step(h):
        view.step(h)
        for mass in masses:
            lib.cpBodyUpdatePosition(mass._body, h)

    return masses, step


def constants(frequency, ratio, mass):
    omega = 2.0 * math.pi * frequency
    return mass * omega**2, 2.0 * mass * ratio * omega


SPRINGS = [(1 / 60, 8.0, 0.3), (1 / 240, 8.0, 0.3), (1 / 480, 30.0, 2.0), (1 / 60, 2.0, 0.0)]


@pytest.mark.parametrize(('h', 'frequency', 'ratio'), SPRINGS)
def test_one_spring_follows_the_closed_form(h, frequency, ratio):
    mass = STILL.mass / 2.0
    k, c = constants(frequency, ratio, mass)
    (a, b), step = row_of_masses(k, c, [1.0], iterations=1)
    x, v = 1.0, 0.0
    for _ in range(200):
        step(h)
        v = (v - h * k * x / mass) / (1.0 + h * c / mass + h * h * k / mass)
        x += h * v
        assert b.position.x - a.position.x - 3.0 == pytest.approx(x, abs=1e-12)
        assert b.velocity.x - a.velocity.x == pytest.approx(v, abs=1e-10)


@pytest.mark.parametrize(('h', 'frequency', 'ratio'), SPRINGS)
def test_two_springs_on_one_mass_follow_implicit_euler(h, frequency, ratio):
    k, c = constants(frequency, ratio, STILL.mass / 2.0)
    masses, step = row_of_masses(k, c, [1.0, -0.4], iterations=400)
    pulls = np.array([[-1.0, 1.0, 0.0], [0.0, -1.0, 1.0]])  # relative velocities of the springs
    stiff = pulls.T @ pulls
    x, v = np.array([1.0, -0.4]), np.zeros(3)
    for _ in range(100):
        step(h)
        left = STILL.mass * np.eye(3) + (h * c + h * h * k) * stiff
        v = np.linalg.solve(left, STILL.mass * v - h * k * pulls.T @ x)
        x = x + h * pulls @ v
        at = np.array([mass.position.x for mass in masses])
        np.testing.assert_allclose(np.diff(at) - 3.0, x, rtol=0.0, atol=1e-10)


def voxel_response(actuation, n_steps, h):
    """Return the area ratios of a voxel without gravity, all 18 springs in one linear system."""
    morphology = parse_morphology('1')
    body = build_body(morphology, FLAT, STILL)
    table = body.constraints
    springs = table.kinds == SPRING
    ends, anchors = table.ends[springs], table.anchors[springs].reshape(-1, 2, 2)
    k, c = table.stiffness[springs], table.damping[springs]
    kinds = [0, 0, 1, 1] * 4 + [2, 2]
    lengths_at = [
        np.array(STILL.rest_lengths(STILL.actuated_side(change)))[kinds]
        for change in (0.0, -math.copysign(STILL.area_range, actuation))
    ]
    rest = lengths_at[0] + abs(actuation) * (lengths_at[1] - lengths_at[0])
    pose = np.column_stack([body.positions, np.zeros(4)])
    speed = np.zeros((4, 3))
    inverse = np.tile([1.0 / STILL.mass, 1.0 / STILL.mass, 1.0 / STILL.moment], 4)
    impulse, areas = np.zeros(18), []
    for _ in range(n_steps):
        rows, lengths = np.zeros((18, 4, 3)), np.empty(18)
        for s in range(18):
            points, arms = [], []
            for mass, anchor in zip(ends[s], anchors[s], strict=True):
                t = pose[mass, 2]
                turn = np.array([[math.cos(t), -math.sin(t)], [math.sin(t), math.cos(t)]])
                arms.append(turn @ anchor)
                points.append(pose[mass, :2] + arms[-1])
            axis = points[1] - points[0]
            lengths[s] = np.hypot(*axis)
            axis = axis / lengths[s]
            for sign, mass, arm in zip((-1.0, 1.0), ends[s], arms, strict=True):
                rows[s, mass] += sign * np.array([*axis, arm[0] * axis[1] - arm[1] * axis[0]])
        jacobian = rows.reshape(18, 12)
        gamma = 1.0 / (h * (c + h * k))
        bias = (lengths - rest) * h * k * gamma
        left = (jacobian * inverse) @ jacobian.T + np.diag(gamma)
        impulse = np.linalg.solve(left, -(jacobian @ speed.ravel() + bias))
        speed = (speed.ravel() + inverse * (jacobian.T @ impulse)).reshape(4, 3)
        pose = pose + h * speed
        corners = []
        for i, (sx, sy) in enumerate(((-1, 1), (1, 1), (1, -1), (-1, -1))):
            t, half = pose[i, 2], STILL.mass_side / 2.0
            turn = np.array([[math.cos(t), -math.sin(t)], [math.sin(t), math.cos(t)]])
            corners.append(pose[i, :2] + turn @ (half * np.array([sx, sy])))
        x, y = np.array(corners).T
        areas.append(abs(np.dot(x, np.roll(y, 1)) - np.dot(y, np.roll(x, 1))) / 2.0 / 9.0)
    return np.array(areas)


@pytest.mark.parametrize('engine', ['pymunk', 'batched'])
@pytest.mark.parametrize(('actuation', 'substeps'), [(-1.0, 1), (0.6, 1), (-0.5, 4)])
def test_the_step_response_of_a_voxel_is_that_of_an_implicit_integrator(
    engine, actuation, substeps
):
    solver = Solver(substeps=substeps, iterations=1000)
    sim = Simulation('1', material=STILL, solver=solver, engine=engine)
    every = voxel_response(actuation, 60 * substeps, 1.0 / 60.0 / substeps)
    expected = every[substeps - 1 :: substeps]
    got = []
    for _ in range(60):
        sim.step([actuation])
        got.append(sim.world.area_ratios[0])
    np.testing.assert_allclose(got, expected, rtol=0.0, atol=1e-8)
    assert got[-1] == pytest.approx(1.0 - 0.225 * actuation, abs=0.01)


def test_ten_iterations_are_near_convergence():
    response = []
    for iterations in (10, 1000):
        sim = Simulation('1', material=STILL, solver=Solver(iterations=iterations))
        response.append([])
        for _ in range(60):
            sim.step([-1.0])
            response[-1].append(sim.world.area_ratios[0])
    assert np.abs(np.subtract(*response)).max() < 0.02


def test_the_view_reads_and_writes_soft_springs():
    body = build_body(parse_morphology('11'), FLAT, Material())
    view = pymunk_view(Space(body, FLAT.polygons, Material(), Solver()))
    springs = [c for c in view.constraints if isinstance(c, pymunk.DampedSpring)]
    table = body.constraints
    assert len(springs) == 36
    for spring, i in zip(springs, np.flatnonzero(table.kinds == SPRING), strict=True):
        assert (*spring.anchor_a, *spring.anchor_b) == tuple(table.anchors[i])
        assert spring.rest_length == table.rest[i]
        assert (spring.stiffness, spring.damping) == (table.stiffness[i], table.damping[i])
    springs[0].stiffness, springs[0].anchor_a = 3.5, (0.1, 0.2)
    assert (springs[0].stiffness, springs[0].anchor_a) == (3.5, (0.1, 0.2))
    assert springs[0].impulse == 0.0
    view.step(1 / 60)
    assert view.collision_slop == 0.005


@pytest.mark.parametrize('engine', ['pymunk', 'batched'])
def test_stiff_springs_stay_near_their_range_under_random_full_actuation(engine):
    material = Material(frequency=30.0, damping_ratio=2.0)
    sim = Simulation('biped', material=material, engine=engine)
    rng, largest = np.random.default_rng(0), 0.0
    for _ in range(300):
        assert np.isfinite(sim.step(rng.choice([-1.0, 1.0], 10))).all()
        largest = max(largest, sim.world.area_ratios.max())
    assert largest < 1.5


def test_another_layout_of_structs_is_rejected(monkeypatch):
    fields = [(name, *SPRING_STRUCT.fields[name]) for name in SPRING_STRUCT.names]
    for swapped in (('rest', 'stiffness'), ('arm_a', 'arm_b'), ('target', 'share')):
        names = [dict(zip(swapped, swapped[::-1], strict=True)).get(f[0], f[0]) for f in fields]
        layout = np.dtype({
            'names': names, 'formats': [f[1] for f in fields], 'offsets': [f[2] for f in fields],
        })
        monkeypatch.setattr(soft_spring, 'SPRING', layout)
        with pytest.raises(ImportError, match='pymunk keeps its springs in another form'):
            soft_spring._functions()
    monkeypatch.setattr(soft_spring, 'SPRING', SPRING_STRUCT)
    assert soft_spring._functions().tolist() == soft_spring.FUNCTIONS.tolist()
