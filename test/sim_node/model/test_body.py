import itertools
import math
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pymunk
import pytest

from sim_node.model.body import LIMIT, SPRING, WELD, build_body, placement
from sim_node.model.material import Material
from sim_node.model.morphology import parse_morphology
from sim_node.model.solver import Solver
from sim_node.model.terrain import UNSEEN_TERRAINS, parse_terrain
from sim_node.munk2d.pymunk_view import SoftSpring, pymunk_view
from sim_node.munk2d.space import Space

PLACED = ('1', 'biped', 'comb', 'worm', 'ball-5', 't-5x3')
OMEGA_2 = (16 * math.pi) ** 2  # of a spring at 8 Hz

# Of one spring of each kind: effective mass [kg] by hand from 1/m1 + 1/m2 + sum (r x n)^2 / I,
# with m = 0.36 and I = 0.0864, and its rest length [m].
PARALLEL = 9 / 125, 0.6  # r x n = 0.6 twice: 50/9 + 2 * 0.36 / 0.0864 = 125/9
SIDE_CROSS = 9 / 185, math.sqrt(1.8)  # r x n = 1.08 / sqrt(1.8) twice: 50/9 + 2 * 7.5 = 185/9
CENTRAL = 0.18, 1.8 * math.sqrt(2)  # from centre to centre: 50/9


def build(shape, terrain='flat', iterations=10, self_collision=False, **material):
    terrain, material = parse_terrain(terrain), Material(**material)
    solver = Solver(iterations=iterations, self_collision=self_collision)
    body = build_body(parse_morphology(shape), terrain, material)
    view = pymunk_view(Space(body, terrain.polygons, material, solver))
    springs = [c for c in view.constraints if isinstance(c, pymunk.DampedSpring)]
    return SimpleNamespace(
        space=view, masses=list(view.bodies), springs=springs, ground=view.static_body
    )


def joints(body, kind):
    return [c for c in body.space.constraints if isinstance(c, kind)]


def ends(joint):
    """Return both anchors in world coordinates [m]."""
    return joint.a.local_to_world(joint.anchor_a), joint.b.local_to_world(joint.anchor_b)


def test_masses_are_in_the_corners_of_a_voxel():
    body = build('1')
    assert [tuple(b.position) for b in body.masses] == [
        pytest.approx(p) for p in ((11.6, 8.4), (13.4, 8.4), (13.4, 6.6), (11.6, 6.6))
    ]
    for mass in body.masses:
        assert mass.mass == pytest.approx(0.36)
        assert mass.moment == pytest.approx(0.0864)
        (shape,) = mass.shapes
        assert sorted(map(tuple, shape.get_vertices())) == [
            pytest.approx(p) for p in ((-0.6, -0.6), (-0.6, 0.6), (0.6, -0.6), (0.6, 0.6))
        ]


def test_every_voxel_has_its_four_masses_in_order():
    morphology, body = parse_morphology('biped'), build('biped')
    assert len(body.masses) == len(body.space.bodies) == 40
    for i, (x, y) in enumerate(morphology.squares):
        center = np.mean([body.masses[j].position for j in range(4 * i, 4 * i + 4)], axis=0)
        assert center == pytest.approx((11 + 3 * x + 1.5, 6 + 3 * y + 1.5))
        for j, corner in enumerate(((-0.9, 0.9), (0.9, 0.9), (0.9, -0.9), (-0.9, -0.9))):
            assert body.masses[4 * i + j].position - center == pytest.approx(corner)


@pytest.mark.parametrize('gone', ['voxel_1_1', 'voxel_0_0', 'voxel_0_0,voxel_0_1,voxel_0_2'])
@pytest.mark.parametrize('terrain', ['flat', 'hilly-1-10-0'])
def test_a_damaged_body_stands_where_the_complete_one_would(gone, terrain):
    whole, ground, material = parse_morphology('biped'), parse_terrain(terrain), Material()
    damaged = whole.without(gone)
    kept = [4 * whole.squares.index(square) + i for square in damaged.squares for i in range(4)]
    one, two = (build_body(shape, ground, material) for shape in (whole, damaged))
    moved = two.positions - one.positions[kept]  # as low as the ground below the others allows
    assert moved[:, 0].tolist() == [0.0] * len(kept)
    assert moved[:, 1] == pytest.approx(np.full(len(kept), moved[0, 1]), abs=1e-12)
    assert -3.0 < moved[0, 1] <= 0.0
    if terrain == 'flat':
        assert moved[0, 1] == 0.0
    assert sum(two.constraints.kinds == SPRING) == 18 * damaged.n_voxels


def test_a_voxel_has_eighteen_springs_of_three_kinds():
    body = build('1')
    pairs = Counter(
        tuple(sorted((body.masses.index(s.a), body.masses.index(s.b)))) for s in body.springs
    )
    assert pairs == {(0, 1): 4, (1, 2): 4, (2, 3): 4, (0, 3): 4, (0, 2): 1, (1, 3): 1}
    kinds = Counter(round(s.rest_length, 9) for s in body.springs)
    assert kinds == {round(k[1], 9): n for k, n in ((PARALLEL, 8), (SIDE_CROSS, 8), (CENTRAL, 2))}


def test_side_springs_join_the_corners_of_two_masses():
    body = build('1')
    top = [s for s in body.springs if {s.a, s.b} == {body.masses[0], body.masses[1]}]
    lines = {frozenset((round(p.x, 9), round(p.y, 9)) for p in ends(s)) for s in top}
    assert lines == {
        frozenset(line) for line in (
            ((12.2, 9.0), (12.8, 9.0)), ((12.2, 7.8), (12.8, 7.8)),
            ((12.2, 9.0), (12.8, 7.8)), ((12.2, 7.8), (12.8, 9.0)),
        )
    }


def test_stiffness_and_damping_by_hand():
    seen = set()
    for spring in build('biped').springs:
        kind = next(k for k in (PARALLEL, SIDE_CROSS, CENTRAL)
                    if spring.rest_length == pytest.approx(k[1]))
        seen.add(kind)
        assert spring.stiffness == pytest.approx(kind[0] * OMEGA_2)
        assert spring.damping == pytest.approx(2 * kind[0] * 0.3 * 16 * math.pi)
    assert len(seen) == 3
    assert PARALLEL[0] * OMEGA_2 == pytest.approx(181.9165, abs=1e-3)


def test_springs_are_at_rest_in_the_robot_put_down():
    for spring in build('comb', 'hilly-1-10-0').springs:
        a, b = ends(spring)
        assert a.get_distance(b) == pytest.approx(spring.rest_length, abs=1e-9)


def test_table_of_rest_lengths():
    body = build('11')
    rest = build_body(parse_morphology('11'), parse_terrain('flat'), Material()).rest_lengths
    assert rest.shape == (3, 36)
    assert [s.rest_length for s in body.springs] == rest[1].tolist()
    for change, lengths in zip((0.775, 1.0, 1.225), rest, strict=True):
        side = 3 * math.sqrt(change)
        kinds = {0.6: side - 2.4, math.sqrt(1.8): math.hypot(1.2, side - 2.4),
                 1.8 * math.sqrt(2): (side - 1.2) * math.sqrt(2)}
        expected = [kinds[min(kinds, key=lambda k, s=s: abs(k - s.rest_length))]
                    for s in body.springs]
        assert lengths == pytest.approx(expected)
    assert (rest[0] < rest[1]).all()
    assert (rest[1] < rest[2]).all()


def test_contraction_limits():
    body = build('11')
    limits = joints(body, pymunk.SlideJoint)
    pairs = [tuple(sorted((body.masses.index(j.a), body.masses.index(j.b)))) for j in limits]
    sides = ((0, 1), (1, 2), (2, 3), (0, 3))
    assert sorted(pairs) == sorted((4 * i + a, 4 * i + b) for i in range(2) for a, b in sides)
    for joint in limits:
        assert (joint.min, joint.max) == (pytest.approx(1.2), math.inf)
        assert tuple(joint.anchor_a) == tuple(joint.anchor_b) == (0.0, 0.0)


@pytest.mark.parametrize(
    ('shape', 'points'),
    [
        ('11', [(14.0, y) for y in (6.0, 7.2, 7.8, 9.0)]),
        ('1-1', [(x, 9.0) for x in (11.0, 12.2, 12.8, 14.0)]),
    ],
)
def test_welds_hold_both_ends_of_the_edges_of_facing_masses(shape, points):
    body = build(shape)
    welds = joints(body, pymunk.PivotJoint)
    assert len(welds) == 4
    places = []
    for weld in welds:
        a, b = ends(weld)
        assert tuple(a) == pytest.approx(tuple(b))
        assert not weld.collide_bodies
        assert (body.masses.index(weld.a) < 4) != (body.masses.index(weld.b) < 4)
        for mass, point in ((weld.a, a), (weld.b, b)):
            assert [abs(c) for c in mass.world_to_local(point)] == pytest.approx([0.6, 0.6])
        places.append((round(a.x, 9), round(a.y, 9)))
    assert sorted(places) == points


@pytest.mark.parametrize(('shape', 'n_shared_sides'), [('1', 0), ('worm', 4), ('biped', 12),
                                                       ('comb', 10), ('box-3x3', 12)])
def test_number_of_welds(shape, n_shared_sides):
    assert len(joints(build(shape), pymunk.PivotJoint)) == 4 * n_shared_sides


def test_constraints_are_in_the_order_of_the_voxels():
    kinds = [type(c).__name__ for c in build('11').space.constraints]
    voxel = ['SoftSpring'] * 18 + ['SlideJoint'] * 4
    assert kinds == voxel + voxel + ['PivotJoint'] * 4


@pytest.mark.parametrize('shape', PLACED)
def test_the_order_that_the_batched_engine_assumes(shape):
    kinds, ends, anchors, *_ = build_body(
        parse_morphology(shape), parse_terrain('flat'), Material()
    ).constraints
    own = [
        *((0, 1),) * 4, *((1, 2),) * 4, *((2, 3),) * 4, *((3, 0),) * 4, (0, 2), (1, 3),
        (0, 1), (1, 2), (2, 3), (3, 0),
    ]
    voxel = -1
    rows = iter(zip(kinds.tolist(), ends.tolist(), anchors.tolist(), strict=True))
    for kind, (a, b), _ in rows:
        if kind == WELD:  # of the voxel before: to an earlier one, and twice between two masses
            assert a // 4 == voxel > b // 4
            assert next(rows)[:2] == (WELD, [a, b])
            continue
        voxel += 1
        of_voxel = [(kind, a, b), *((kind, a, b) for kind, (a, b), _ in itertools.islice(rows, 21))]
        assert of_voxel == [
            (SPRING if i < 18 else LIMIT, 4 * voxel + a, 4 * voxel + b)
            for i, (a, b) in enumerate(own)
        ]
    assert not anchors[kinds == LIMIT].any()


@pytest.mark.parametrize('shape', ['1', 'biped', 'comb', 't-5x3'])
def test_the_space_has_the_numbers_of_the_tables(shape):
    body = build(shape, 'hilly-1-10-0', damping_ratio=0.2)
    terrain = parse_terrain('hilly-1-10-0')
    table = build_body(parse_morphology(shape), terrain, Material(damping_ratio=0.2))
    assert [tuple(b.position) for b in body.masses] == [*map(tuple, table.positions.tolist())]
    numbers = {
        SoftSpring: lambda c: (SPRING, c.rest_length, c.stiffness, c.damping),
        pymunk.SlideJoint: lambda c: (LIMIT, c.min, 0.0, 0.0),
        pymunk.PivotJoint: lambda c: (WELD, 0.0, 0.0, 0.0),
    }
    index = {mass: i for i, mass in enumerate(body.masses)}
    rows = [
        (index[c.a], index[c.b], *c.anchor_a, *c.anchor_b, *numbers[type(c)](c))
        for c in body.space.constraints
    ]
    kinds, ends, anchors, *others = table.constraints
    assert rows == [*map(tuple, np.column_stack([ends, anchors, kinds, *others]).tolist())]


def test_contact_coefficients_and_world():
    body = build('1', iterations=13, gravity=3.0, damping=0.2)
    (mass,) = body.masses[0].shapes
    for ground in body.ground.shapes:
        assert mass.friction * ground.friction == pytest.approx(math.sqrt(10 * 0.2))
        assert mass.elasticity * ground.elasticity == pytest.approx(0.1)
    assert tuple(body.space.gravity) == (0.0, -3.0)
    assert body.space.damping == pytest.approx(math.exp(-0.2))
    assert body.space.iterations == 13


def collide(a, b):
    """Return whether shapes with these filters collide, by Munk2D's rule."""
    same_group = a.group != 0 and a.group == b.group
    return bool(not same_group and a.categories & b.mask and b.categories & a.mask)


@pytest.mark.parametrize('self_collision', [False, True, 'reference'])
def test_collision_filters(self_collision):
    body = build('11', self_collision=self_collision)
    filters = [shape.filter for mass in body.masses for shape in mass.shapes]
    for a, b in itertools.combinations(filters, 2):
        assert collide(a, b) == bool(self_collision)
    for ground in body.ground.shapes:
        assert all(collide(f, ground.filter) for f in filters)
    apart = {type(c).__name__ for c in body.space.constraints if not c.collide_bodies}
    every = {'SoftSpring', 'SlideJoint', 'PivotJoint'}
    assert apart == (every if self_collision == 'reference' else {'PivotJoint'})


def test_friction_and_restitution_of_pairs():
    for self_collision, of_itself in ((True, (2.0, 0.01)), ('reference', (10.0, 0.1))):
        body = build('1', self_collision=self_collision)
        (mass,) = body.masses[0].shapes
        for ground in body.ground.shapes:
            assert mass.friction * ground.friction == pytest.approx(math.sqrt(2.0))
            assert mass.elasticity * ground.elasticity == pytest.approx(0.1)
        assert (mass.friction**2, mass.elasticity**2) == pytest.approx(of_itself)


def test_self_collision_of_the_reference():
    """At rest the only contacts are between diagonal masses at a corner that four voxels share."""
    body = build('11-11', self_collision='reference', gravity=0.0)
    for mass in body.masses:
        mass.position += (50.0, 100.0)
    index = {mass: i for i, mass in enumerate(body.masses)}
    body.space.step(1e-6)
    touching = set()
    for mass in body.masses:
        mass.each_arbiter(lambda arbiter: touching.add(frozenset(index[b] for b in arbiter.bodies)))
    joined = {frozenset((index[c.a], index[c.b])) for c in body.space.constraints}
    assert not touching & joined
    assert touching == {frozenset((1, 15)), frozenset((4, 10))}


@pytest.mark.parametrize('terrain', ['flat', 'hilly-1-10-0', 'steppy-0.5-10-3', 'uphill-20'])
def test_ground_surface_is_the_profile(terrain):
    profile, body = parse_terrain(terrain), build('1', terrain)
    middles = (profile.x[:-1] + profile.x[1:]) / 2
    for x in middles[:40]:
        y = profile.height_at(x)
        hit = body.space.segment_query_first(
            (x, y + 50.0), (x, y - 10.0), 0.0, pymunk.ShapeFilter(mask=0b10)
        )
        assert hit.shape.body is body.ground
        assert hit.point.y == pytest.approx(y, abs=1e-6)


@pytest.mark.parametrize('shape', PLACED)
@pytest.mark.parametrize('terrain', ['flat', *UNSEEN_TERRAINS])
def test_placement(shape, terrain):
    morphology, profile = parse_morphology(shape), parse_terrain(terrain)
    body = build(shape, terrain)
    corners = np.array([
        b.local_to_world(v) for b in body.masses for s in b.shapes for v in s.get_vertices()
    ])
    assert corners[:, 0].min() == pytest.approx(11.0)
    x0, y0 = placement(morphology, profile, Material())
    assert (x0, y0) == pytest.approx((11.0, corners[:, 1].min()))
    # The clearance below the lower edge of every voxel, sampled every millimetre.
    gaps = [
        y0 + 3 * y - np.interp(np.linspace(11 + 3 * x, 14 + 3 * x, 3001), profile.x, profile.y)
        for x, y in morphology.squares
    ]
    assert np.min(gaps) == pytest.approx(1.0, abs=1e-3)
    assert np.min(gaps) >= 1.0 - 1e-9


def test_placement_on_slopes_by_hand():
    tan = 0.36397023426620234
    worm = parse_morphology('worm')
    _, up = placement(worm, parse_terrain('uphill-20'), Material())
    assert up == pytest.approx(5 + (26 - 10) * tan + 1)  # the right-most corner decides
    _, down = placement(worm, parse_terrain('downhill-20'), Material())
    assert down == pytest.approx(5 + (1990 - 11) * tan + 1)  # the left-most corner decides
    biped = parse_morphology('biped')
    _, leg = placement(biped, parse_terrain('uphill-20'), Material())
    assert leg == pytest.approx(5 + (23 - 10) * tan + 1)


def test_other_sizes_scale_with_the_side():
    body = build('11', side=1.0)
    assert body.masses[0].position == pytest.approx((11.2, 6.8))
    assert body.masses[5].position == pytest.approx((12.8, 6.8))
    assert body.springs[0].rest_length == pytest.approx(0.2)
