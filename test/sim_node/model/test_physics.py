"""The two physics by name, and the poses at which the reference physics reads sensors."""

import numpy as np
import pytest

from sim_node.engine import ENGINES
from sim_node.errors import InvalidInput
from sim_node.model.physics import DEFAULT_PHYSICS, PHYSICS
from sim_node.model.solver import Solver
from sim_node.munk2d.pymunk_view import pymunk_view
from sim_node.simulation import Simulation


def test_names():
    assert DEFAULT_PHYSICS == Solver().physics == 'reference'
    assert Solver.from_dict({}).physics == 'first'
    assert Solver.from_dict({'physics': 'reference'}) == Solver()
    with pytest.raises(InvalidInput, match=r"solver\.physics.*did you mean 'reference'"):
        Solver(physics='referense')
    assert PHYSICS['reference'].slop == 0.005


@pytest.mark.parametrize('engine', ENGINES)
def test_the_reference_physics_reads_poses_at_the_end_of_the_step(engine):
    """In free fall without internal motion the two physics differ only in the end of a step."""
    now, late = (
        Simulation('1', solver=Solver(physics=physics), engine=engine)
        for physics in ('reference', 'first')
    )
    late.step([0.0])
    for _ in range(15):
        before = now.world.masses.copy()
        now.step([0.0])
        late.step([0.0])
        np.testing.assert_allclose(now.world.masses[:, :3], late.world.masses[:, :3], atol=1e-12)
        moved = now.world.masses[:, :2] - before[:, :2]
        np.testing.assert_allclose(moved, now.world.masses[:, 3:] / 60.0, atol=1e-12)


@pytest.mark.parametrize('engine', ENGINES)
@pytest.mark.parametrize('terrain', ['flat', 'uphill-20', 'steppy-0.5-10-0'])
def test_touch_is_read_in_the_step_in_which_the_mass_arrives(engine, terrain):
    sim = Simulation('11', terrain, engine=engine)
    for _ in range(120):
        sim.step([0.0, 0.0])
        below = [
            min(y - sim.terrain.height_at(x) for x, y in corners) <= 0.0
            for corners in sim.world.corners.tolist()
        ]
        touching = sim.world.touching > 0.0
        assert not (np.array(below) & ~touching).any()
        if touching.any():
            break
    assert touching.any()
    assert sim.velocity[1] < -3.0  # the contact has not yet stopped it


def test_touch_agrees_with_the_contacts_of_munk2d():
    """A step of Munk2D begins with the contacts at the poses that sensors read before it."""
    sim = Simulation('biped', 'hilly-1-10-1')
    rng = np.random.default_rng(0)
    view = pymunk_view(sim.backend.space)
    masses = list(view.bodies)
    for k in range(400):
        predicted = sim.world.touching.copy()
        sim.step(rng.choice([-1.0, 1.0], 10) if k % 5 == 0 else sim.world.actuation)
        found: list = [[] for _ in masses]
        for mass, contacts in zip(masses, found, strict=True):
            mass.each_arbiter(contacts.append)
        touched = np.array([bool(contacts) for contacts in found]).reshape(-1, 4).any(axis=1)
        assert np.array_equal(touched, predicted > 0.0), k
