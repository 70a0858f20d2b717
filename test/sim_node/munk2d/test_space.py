import gc
import math

import numpy as np
import pymunk
import pytest

from sim_node.model.body import LIMIT, SPRING, build_body
from sim_node.model.material import Material
from sim_node.model.morphology import parse_morphology
from sim_node.model.solver import Solver
from sim_node.model.terrain import parse_terrain
from sim_node.munk2d import space as space_module
from sim_node.munk2d.c_functions import handle
from sim_node.munk2d.pymunk_view import pymunk_view
from sim_node.munk2d.space import Space
from sim_node.simulation import Simulation

ODD = Material(
    side=2.7, mass_ratio=0.33, density=0.7, frequency=5.0, damping_ratio=0.1, area_range=0.1,
    friction=0.3, restitution=0.6, damping=1.1, gravity=3.3,
)


def pymunk_space(body, terrain, material, solver):
    """Return the space of the same robot, built from pymunk objects."""
    space = pymunk.Space()
    space.iterations = solver.iterations
    space.gravity = (0.0, -material.gravity)
    space.damping = math.exp(-material.damping)
    base = terrain.y.min() - 50.0
    points = list(zip(terrain.x.tolist(), terrain.y.tolist(), strict=True))
    for (x0, y0), (x1, y1) in zip(points[:-1], points[1:], strict=True):
        corners = [(x0, base), (x1, base), (x1, y1), (x0, y0)]
        shape = pymunk.Poly(space.static_body, corners)
        shape.friction = shape.elasticity = 1.0
        shape.filter = pymunk.ShapeFilter(categories=0b10)
        space.add(shape)
    for position in body.positions.tolist():
        mass = pymunk.Body(material.mass, material.moment)
        mass.position = tuple(position)
        shape = pymunk.Poly.create_box(mass, (material.mass_side, material.mass_side))
        shape.friction, shape.elasticity = material.friction, material.restitution
        mask = 0b11 if solver.self_collision else 0b10
        shape.filter = pymunk.ShapeFilter(categories=0b01, mask=mask)
        space.add(mass, shape)
    masses = list(space.bodies)
    columns = (column.tolist() for column in body.constraints)
    for kind, (a, b), (ax, ay, bx, by), *numbers in zip(*columns, strict=True):
        between = masses[a], masses[b], (ax, ay), (bx, by)
        if kind == SPRING:
            space.add(pymunk.DampedSpring(*between, *numbers))
        elif kind == LIMIT:
            space.add(pymunk.SlideJoint(*between, numbers[0], math.inf))
        else:
            weld = pymunk.PivotJoint(*between)
            weld.collide_bodies = False
            space.add(weld)
    return space


def two_spaces(shape, terrain, options):
    """Return a view of a `Space`, and the same space built from pymunk objects."""
    terrain, (material, solver) = parse_terrain(terrain), options
    body = build_body(parse_morphology(shape), terrain, material)
    view = pymunk_view(Space(body, terrain.polygons, material, solver))
    return view, pymunk_space(body, terrain, material, solver)


FIRST = Solver(physics='first')  # Munk2D without changes

OPTIONS = [(Material(), FIRST), (ODD, Solver(1, 7, True, 'first'))]


@pytest.mark.parametrize('options', OPTIONS)
def test_shapes_equal_those_of_pymunk_objects(options):
    shapes = [
        [(s.get_vertices(), s.radius, s.friction, s.elasticity, s.filter) for s in space.shapes]
        for space in two_spaces('biped', 'hilly-1-10-0', options)
    ]
    assert shapes[0] == shapes[1]


@pytest.mark.parametrize('shape', ['1', 'biped', 'comb', '11-11'])
@pytest.mark.parametrize('terrain', ['flat', 'hilly-2-20-0', 'steppy-0.5-10-3', 'downhill-20'])
@pytest.mark.parametrize('options', OPTIONS)
def test_motion_equals_that_of_pymunk_objects_bit_for_bit(shape, terrain, options):
    view, expected = two_spaces(shape, terrain, options)
    rng, touched = np.random.default_rng(0), []
    for k in range(180):
        speeds = rng.normal(0.0, 3.0, (len(view.bodies), 2)).tolist() if k % 30 == 0 else None
        for space in (view, expected):
            for mass, speed in zip(space.bodies, speeds or (), strict=False):
                mass.velocity += speed
            space.step(1 / 60)
        states = [
            np.array([(*b.position, b.angle, *b.velocity, b.angular_velocity) for b in s.bodies])
            for s in (view, expected)
        ]
        assert states[0].tobytes() == states[1].tobytes()
        for mass in view.bodies:
            mass.each_arbiter(touched.append)
    assert touched


def test_handles_are_in_the_order_of_the_tables():
    terrain = parse_terrain('flat')
    body = build_body(parse_morphology('biped'), terrain, Material())
    space = Space(body, terrain.polygons, Material(), Solver())
    view = pymunk_view(space)
    assert [handle(b._body) for b in view.bodies] == space.bodies.tolist()
    springs = [c for c in view.constraints if isinstance(c, pymunk.DampedSpring)]
    assert [handle(s._constraint) for s in springs] == space.springs.tolist()
    assert body.rest_lengths.shape == (3, len(springs))
    assert {handle(s.body._body) for s in view.static_body.shapes} == {space.ground}


def test_changes_to_the_view_move_the_simulated_robot():
    sim = Simulation('1')
    for mass in pymunk_view(sim.backend.space).bodies:
        mass.position += (50.0, 100.0)
        mass.velocity = (3.0, 0.0)
    sim.step([0.0])
    assert sim.center == pytest.approx((12.5 + 50.0 + 0.05, 7.5 + 100.0), abs=0.01)
    assert sim.velocity[0] == pytest.approx(3.0, rel=0.01)


def test_a_space_is_freed_once(monkeypatch):
    freed, free = [], space_module._loaded_free()

    def note(*arrays):
        freed.append(arrays[0])
        free(*arrays)

    monkeypatch.setattr(space_module, '_loaded_free', lambda: note)
    sim = Simulation('biped', 'hilly-1-10-0')
    spaces = [sim.backend.space.handle]
    sim.reset()
    assert freed == spaces
    view = pymunk_view(sim.backend.space)
    mass = next(iter(view.bodies))
    spaces.append(sim.backend.space.handle)
    del sim, view
    gc.collect()
    assert freed == spaces[:1]  # the mass keeps a reference to its space
    assert mass.mass == pytest.approx(0.36)
    del mass
    gc.collect()
    assert freed == spaces


def test_resets_do_not_leak_memory():
    def resident():
        with open('/proc/self/statm') as statm:
            return int(statm.read().split()[1])

    sim = Simulation('biped')

    def reset(times):
        for _ in range(times):
            sim.reset()
            sim.step(np.ones(10))

    reset(300)
    before = resident()
    reset(2000)
    assert resident() - before < 256  # pages: half a kilobyte per reset; a mass alone takes more
