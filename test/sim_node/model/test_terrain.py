import math
import re

import numpy as np
import pymunk
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_node.errors import InvalidInput
from sim_node.model.terrain import (
    DEFAULT_TERRAIN_SET,
    TERRAIN_SETS,
    UNSEEN_KINDS,
    UNSEEN_TERRAINS,
    parse_terrain,
    unseen_terrains,
)

TAN20 = 0.36397023426620234
nearly_names = st.from_regex(
    r'(flat|hilly|steppy|uphill|downhill|stairs|)(-[0-9.]{0,6}){0,4}', fullmatch=True
)


def parsed(text):
    """Return (terrain, None) or (None, InvalidInput); other exceptions propagate."""
    try:
        return parse_terrain(text), None
    except InvalidInput as error:
        return None, error


def check_profile(terrain):
    """Assert what holds for every terrain: walls at both ends, increasing x, finite numbers."""
    x, y = terrain.x, terrain.y
    assert x.shape == y.shape
    assert np.isfinite(x).all()
    assert np.isfinite(y).all()
    assert (np.diff(x) > 0).all()
    assert x[0] == 0.0
    assert x[-1] >= 2000.0
    assert terrain.start == x[1] == 10.0
    assert x[-1] - x[-2] == pytest.approx(10.0)
    assert y[0] - y[1] == pytest.approx(95.0)
    assert y[-1] - y[-2] == pytest.approx(95.0)


def test_flat():
    flat = parse_terrain('flat')
    assert flat.x.tolist() == [0.0, 10.0, 1990.0, 2000.0]
    assert flat.y.tolist() == [100.0, 5.0, 5.0, 100.0]
    check_profile(flat)


def test_height_between_and_beyond_the_corners():
    flat = parse_terrain('flat')
    heights = [flat.height_at(x) for x in (-3.0, 0.0, 5.0, 10.0, 777.7, 1992.5, 2001.0)]
    assert heights == [100.0, 100.0, 52.5, 5.0, 5.0, 28.75, 100.0]


def test_slopes():
    up, down = parse_terrain('uphill-20'), parse_terrain('downhill-20')
    check_profile(up)
    check_profile(down)
    assert up.height_at(10.0) == down.height_at(1990.0) == 5.0
    assert up.height_at(110.0) == pytest.approx(5.0 + 100.0 * TAN20, rel=1e-12)
    assert down.height_at(10.0) == pytest.approx(5.0 + 1980.0 * TAN20, rel=1e-12)
    assert down.height_at(11.0) - down.height_at(12.0) == pytest.approx(TAN20)
    assert parse_terrain('uphill-45.0').height_at(11.0) == pytest.approx(6.0)


@pytest.mark.parametrize(('spread', 'run'), [(0.5, 10), (1, 20), (2, 30)])
def test_hilly_statistics(spread, run):
    terrains = [parse_terrain(f'hilly-{spread}-{run}-{seed}') for seed in range(6)]
    runs = np.concatenate([np.diff(t.x[1:-1]) for t in terrains])
    rises = np.concatenate([np.diff(t.y[1:-1]) for t in terrains])
    n = len(runs)
    assert runs.min() >= 1.0
    assert runs.mean() == pytest.approx(run, abs=4 * 0.25 * run / n**0.5)
    assert runs.std() == pytest.approx(0.25 * run, rel=4 / (2 * n) ** 0.5)
    assert rises.mean() == pytest.approx(0.0, abs=4 * spread / n**0.5)
    assert rises.std() == pytest.approx(spread, rel=4 / (2 * n) ** 0.5)
    for terrain in terrains:
        check_profile(terrain)


@pytest.mark.parametrize(('spread', 'run'), [(0.25, 10), (1, 30)])
def test_steppy_is_flat_runs_and_short_rises(spread, run):
    terrains = [parse_terrain(f'steppy-{spread}-{run}-{seed}') for seed in range(6)]
    for terrain in terrains:
        check_profile(terrain)
        dx, dy = np.diff(terrain.x[1:-1]), np.diff(terrain.y[1:-1])
        assert (dy[::2] == 0.0).all()
        assert (dx[::2] >= 1.0).all()
        assert dx[1::2] == pytest.approx(0.5)
        assert (dy[1::2] != 0.0).all()
    runs = np.concatenate([np.diff(t.x[1:-1])[::2] for t in terrains])
    rises = np.concatenate([np.diff(t.y[1:-1])[1::2] for t in terrains])
    n = len(runs)
    assert runs.mean() == pytest.approx(run, abs=4 * 0.25 * run / n**0.5)
    assert rises.std() == pytest.approx(spread, rel=4 / (2 * n) ** 0.5)


@pytest.mark.parametrize(('growth', 'run'), [('0.1', 10.0), ('0.25', 7.5)])
def test_stairs_are_flat_runs_and_rises_that_grow(growth, run):
    stairs = parse_terrain(f'stairs-{growth}-{run}')
    check_profile(stairs)
    assert stairs.height_at(10.0) == stairs.height_at(10.0 + run) == 5.0
    for n in (1, 2, 7, 30):  # on the flat after the n-th rise
        x = 10.0 + n * (run + 0.5) + run / 2
        assert stairs.height_at(x) == pytest.approx(5.0 + float(growth) * n * (n + 1) / 2)
    rises = np.diff(stairs.y[1:-1])
    assert (rises[::2] == 0.0).all()
    assert rises[1::2] == pytest.approx(float(growth) * np.arange(1, len(rises) // 2 + 1))
    assert np.diff(stairs.x[1:-1]) == pytest.approx(np.tile([run, 0.5], len(rises) // 2))
    assert 1990.0 <= stairs.x[-2] < 1990.0 + run + 0.5


def test_runs_are_never_shorter_than_one_metre():
    runs = np.diff(parse_terrain('hilly-1-1-3').x[1:-1])
    assert runs.min() == pytest.approx(1.0)
    assert np.median(runs) < 1.2


def test_the_seed_determines_the_terrain():
    a, b, c = (parse_terrain(f'hilly-1-10-{seed}') for seed in (0, 0, 1))
    assert a.x.tobytes() == b.x.tobytes()
    assert a.y.tobytes() == b.y.tobytes()
    assert a.y[:5].tolist() != c.y[:5].tolist()


def test_published_terrains_never_change():
    # numpy.random.default_rng(0).standard_normal(4)
    run_0, rise_0, run_1, rise_1 = 0.1257302210933933, -0.1321048632913019, 0.6404226504432821, \
        0.10490011715303971
    hilly = parse_terrain('hilly-1-10-0')
    assert hilly.x[2] == pytest.approx(10.0 + 10.0 * (1.0 + 0.25 * run_0), rel=1e-14)
    assert hilly.x[3] - hilly.x[2] == pytest.approx(10.0 * (1.0 + 0.25 * run_1), rel=1e-14)
    assert hilly.y[2] == pytest.approx(5.0 + rise_0, rel=1e-14)
    assert hilly.y[3] - hilly.y[2] == pytest.approx(rise_1, rel=1e-12)
    steppy = parse_terrain('steppy-0.5-10-0')
    assert steppy.x[3] - steppy.x[2] == pytest.approx(0.5)
    assert steppy.y[3] == pytest.approx(5.0 + 0.5 * rise_0, rel=1e-14)


def test_names_of_the_unseen_terrains():
    assert UNSEEN_TERRAINS == (
        'hilly-0.5-10-1', 'hilly-0.5-20-2', 'hilly-1-10-3', 'hilly-1-20-4', 'hilly-2-20-5',
        'hilly-2-30-6', 'steppy-0.25-10-7', 'steppy-0.25-20-8', 'steppy-0.5-10-9',
        'steppy-0.5-20-10', 'steppy-1-20-11', 'steppy-1-30-12',
        'downhill-10', 'downhill-20', 'uphill-10', 'uphill-20',
    )
    assert {
        'seeds-1-12': UNSEEN_TERRAINS,
        'seed-0': tuple(re.sub(r'^(\D+-.+-.+)-\d+$', r'\1-0', name) for name in UNSEEN_TERRAINS),
    } == TERRAIN_SETS
    assert DEFAULT_TERRAIN_SET == 'seeds-1-12'
    for name in (*UNSEEN_TERRAINS, *TERRAIN_SETS['seed-0']):
        terrain = parse_terrain(name)
        check_profile(terrain)
        assert terrain.name == name


@pytest.mark.parametrize('n', [1, 2, 10])
def test_unseen_terrains_have_different_seeds_and_more_seeds_only_add_terrains(n):
    found = unseen_terrains(n)
    assert tuple(found) == UNSEEN_KINDS
    names = [name for of_kind in found.values() for name in of_kind]
    seeds = [int(name.rpartition('-')[2]) for name in names if name[0] in 'hs']
    assert sorted(seeds) == list(range(1, 12 * n + 1))
    assert len(names) == 12 * n + 4
    assert tuple(of_kind[0] for of_kind in found.values()) == UNSEEN_TERRAINS
    for kind, of_kind in found.items():
        assert all(name == kind or name.startswith(f'{kind}-') for name in of_kind)
        assert unseen_terrains(n + 1)[kind][: len(of_kind)] == of_kind
    assert found['uphill-20'] == ('uphill-20',)
    profiles = {parse_terrain(name).y[:9].tobytes() for name in names}
    assert len(profiles) == len(names)


@pytest.mark.parametrize('n', [0, -1, 1001, 1.0, True, '2', None])
def test_number_of_terrain_seeds_out_of_range(n):
    with pytest.raises(InvalidInput, match=r'terrain_seeds: .* an integer from 1 to 1000'):
        unseen_terrains(n)


@given(st.one_of(st.text(max_size=70), nearly_names))
def test_any_string_is_a_terrain_or_invalid_input(text):
    terrain, error = parsed(text)
    if error:
        assert error.field == 'terrain'
        assert '\n' not in str(error)
    else:
        check_profile(terrain)


@given(
    st.sampled_from(['hilly', 'steppy']), st.floats(0, 100), st.floats(1, 1000),
    st.integers(0, 10**30),
)
def test_any_numbers_in_range_are_accepted(kind, spread, run, seed):
    check_profile(parse_terrain(f'{kind}-{spread:.6f}-{run:.6f}-{seed}'))


@pytest.mark.parametrize(
    'name',
    [
        '', 'flat-', 'flat-1', ' flat', 'flat\n', 'Flat', 'hilly', 'hilly-1-10', 'hilly-1-10-0-0',
        'hilly--1-10-0', 'hilly-1-10--1', 'hilly-1-10-0.5', 'hilly-1-0.9-0', 'hilly-1-1001-0',
        'hilly-101-10-0', 'hilly-nan-10-0', 'hilly-1e1-10-0', 'steppy-1-10', 'uphill', 'uphill-',
        'uphill-61', 'uphill--5', 'downhill-90', 'stairs', 'stairs-0.1', 'stairs-0.1-10-0',
        'stairs-1.01-10', 'stairs-0.1-0.9', 'stairs-0.1-1001', 'hilly-١-10-0',
        'hilly-1-10-' + '0' * 60, None, 3,
    ],
)
def test_invalid_names_are_rejected(name):
    with pytest.raises(InvalidInput):
        parse_terrain(name)


def test_limits_are_inclusive():
    for name in (
        'hilly-100-1-0', 'hilly-0-1000-0', 'uphill-60', 'downhill-0', 'stairs-1-1', 'stairs-0-1000',
    ):
        check_profile(parse_terrain(name))
    assert parse_terrain('uphill-60').height_at(11.0) == pytest.approx(5.0 + math.sqrt(3.0))


@pytest.mark.parametrize(
    'name',
    ['flat', *UNSEEN_TERRAINS, 'steppy-100-1-0', 'uphill-60', 'stairs-0.1-10', 'stairs-1-1'],
)
def test_polygons_are_their_own_convex_hulls(name):
    terrain = parse_terrain(name)
    polygons = [[tuple(p) for p in polygon] for polygon in terrain.polygons.tolist()]
    assert len(polygons) == len(terrain.x) - 1
    for polygon in polygons:
        assert pymunk.Poly(None, polygon).get_vertices() == polygon


@pytest.mark.parametrize('name', ['flat', 'hilly-1-10-0'])
def test_repr_is_the_name(name):
    assert repr(parse_terrain(name)) == str(parse_terrain(name)) == f'Terrain({name!r})'
    assert parse_terrain(name) != parse_terrain(name)  # arrays are not compared
