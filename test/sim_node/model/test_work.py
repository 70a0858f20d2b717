"""The work of the actuators, against arithmetic on the springs themselves and closed forms."""

import math

import numpy as np
import pymunk
import pytest

from sim_node.model.body import CORNERS, SPRING, build_body
from sim_node.model.material import Material
from sim_node.model.solver import Solver
from sim_node.model.work import make_work_meter, measure_work, nothing_measured
from sim_node.munk2d.pymunk_view import pymunk_view
from sim_node.simulation import Simulation


class Measured:
    """A simulation whose work is measured after each step."""

    def __init__(self, *arguments, **options):
        self.simulation = Simulation(*arguments, **options)
        self.meter = make_work_meter(self.simulation.morphology, self.simulation.material)
        self._measure()

    def _measure(self):
        world = self.simulation.world
        measure_work(self.meter, world.masses[..., None].copy(), world.actuation[:, None].copy())

    def step(self, actuation):
        """Return the work [J] of each voxel."""
        self.simulation.step(actuation)
        self._measure()
        return self.meter.work[:, 0].copy()


def energies(lengths, rest, stiffness):
    """Return the elastic energy [J] of each voxel from those of its 18 springs."""
    return (0.5 * stiffness * (lengths - rest) ** 2).reshape(-1, 18).sum(axis=1)


def flips(n_steps, n_voxels, seed=0):
    """Return actuation that often stays, and sometimes leaves [-1, 1]."""
    rng = np.random.default_rng(seed)
    values = rng.uniform(-1.3, 1.3, (n_steps, n_voxels))
    return np.where(rng.random(values.shape) < 0.5, values, np.round(values[:1]))


@pytest.mark.parametrize('solver', [Solver(), Solver(physics='first', substeps=2)])
def test_work_is_the_change_of_energy_of_munk2ds_springs_at_fixed_masses(solver):
    robot = Measured('biped', 'hilly-1-10-0', solver=solver)
    view = pymunk_view(robot.simulation.backend.space)
    springs = [c for c in view.constraints if isinstance(c, pymunk.DampedSpring)]
    stiffness = np.array([s.stiffness for s in springs])
    signs = set()
    for actuation in flips(60, 10):
        lengths = np.array([
            s.a.local_to_world(s.anchor_a).get_distance(s.b.local_to_world(s.anchor_b))
            for s in springs
        ])
        old = np.array([s.rest_length for s in springs])
        work = robot.step(actuation)
        new = np.array([s.rest_length for s in springs])
        expected = energies(lengths, new, stiffness) - energies(lengths, old, stiffness)
        np.testing.assert_allclose(work, expected, rtol=1e-9, atol=1e-9)
        signs |= {*np.sign(work)}
    assert signs >= {-1.0, 1.0}


def test_work_in_the_batched_engine_is_that_of_the_tables():
    robot = Measured('comb', 'uphill-10', engine='batched')
    simulation = robot.simulation
    body = build_body(simulation.morphology, simulation.terrain, simulation.material)
    table, (short, rest, long) = body.constraints, body.rest_lengths
    rows = np.flatnonzero(table.kinds == SPRING)
    before = np.zeros(simulation.morphology.n_voxels)
    for actuation in np.clip(flips(60, len(before), 1), -1.0, 1.0):
        x, y, angle = simulation.world.masses[:, :3].T
        turn, place = np.exp(1j * angle), x + 1j * y
        ends, anchors = table.ends[rows], table.anchors[rows] @ np.kron(np.eye(2), [[1], [1j]])
        lengths = abs(np.diff(place[ends] + turn[ends] * anchors, axis=1)[:, 0])

        def energy(values, lengths=lengths):
            a = np.repeat(values, 18)
            r = rest + np.where(a > 0.0, short - rest, long - rest) * abs(a)
            return energies(lengths, r, table.stiffness[rows])

        expected = energy(actuation) - energy(before)
        np.testing.assert_allclose(robot.step(actuation), expected, rtol=1e-9, atol=1e-9)
        before = actuation


@pytest.mark.parametrize('actuation', [1.0, 0.5, -1.0])
def test_first_work_of_a_voxel_in_closed_form(actuation):
    m = Material()
    half, at_rest = m.mass_side / 2, m.rest_lengths(m.side)
    extreme = m.rest_lengths(m.actuated_side(-math.copysign(m.area_range, actuation)))
    parallel, cross, _ = at_rest
    arms = half, half * (parallel + m.mass_side) / cross, 0.0  # of anchors about their masses
    expected = 0.0
    for n, length, other, arm in zip((8, 8, 2), at_rest, extreme, arms, strict=True):
        m_eff = 1.0 / (2.0 / m.mass + 2.0 * arm**2 / m.moment)
        stiffness = m_eff * (2.0 * math.pi * m.frequency) ** 2
        expected += n * stiffness / 2.0 * ((other - length) * actuation) ** 2
    robot = Measured('1')
    assert robot.step([actuation]) == pytest.approx([expected], rel=1e-9)
    assert robot.step([actuation]) == 0.0


def test_the_work_becomes_elastic_and_kinetic_energy():
    free = Material(gravity=0.0, damping=0.0, damping_ratio=0.0)
    robot = Measured('1', material=free, solver=Solver(physics='first', substeps=64))
    work = robot.step([0.6])[0]
    for _ in range(3):
        masses = robot.simulation.world.masses
        kinetic = 0.5 * free.mass * (masses[:, 3:] ** 2).sum()
        lengths = robot.meter.lengths[:, 0]
        short, rest = robot.meter.rest[:, 0], robot.meter.rest[:, 1]
        elastic = energies(lengths, rest + (short - rest) * 0.6, robot.meter.stiffness)[0]
        assert kinetic + elastic == pytest.approx(work, rel=0.02)
        assert kinetic > 0.01 * work
        assert robot.step([0.6])[0] == 0.0


def test_an_actuator_that_returns_at_once_gets_some_of_its_work_back():
    robot = Measured('1', material=Material(gravity=0.0))
    there = robot.step([0.5])[0]
    back = robot.step([0.0])[0]
    assert 0.0 < -back < there / 2.0  # the masses have begun to move
    for _ in range(300):
        robot.step([0.5])
    assert robot.step([0.0]) == pytest.approx([there], rel=1e-3)  # it rests at the other lengths


def test_nothing_measured_costs_no_springs_and_has_the_same_types():
    meter = make_work_meter(Simulation('11').morphology, Material(), 4)
    empty = nothing_measured(meter)
    assert sum(array.size for array in empty) == 0
    assert [(a.dtype, a.ndim) for a in empty] == [(a.dtype, a.ndim) for a in meter]
    measure_work(empty, np.full((8, 5, 4), np.nan), np.zeros((2, 4)))
    assert len(CORNERS) * 2 == len(meter.axes)
