import dataclasses
import math

import pytest

from sim_node.errors import InvalidInput
from sim_node.model.material import Material

FIELDS = {f.name: f for f in dataclasses.fields(Material)}


def test_defaults_are_those_of_the_reference():
    values = dataclasses.asdict(Material())
    assert values.pop('friction') == pytest.approx(1.4142135623730951)
    assert values == {
        'side': 3.0, 'mass_ratio': 0.4, 'density': 0.25, 'frequency': 8.0, 'damping_ratio': 0.3,
        'area_range': 0.225, 'restitution': 0.1, 'damping': 0.1, 'gravity': 9.8,
    }


def test_corner_mass_is_a_square():
    material = Material()
    assert material.mass_side == pytest.approx(1.2)
    assert material.mass == pytest.approx(0.36)
    assert material.moment == pytest.approx(0.36 * (1.2**2 + 1.2**2) / 12)
    heavy = Material(side=2.0, mass_ratio=0.25, density=2.0)
    assert (heavy.mass_side, heavy.mass) == (0.5, 0.5)
    assert heavy.moment == pytest.approx(0.5 * 0.25 / 6)


@pytest.mark.parametrize(
    ('area_change', 'side', 'lengths'),
    [
        (0.0, 3.0, (0.6, 1.3416407865, 2.5455844123)),
        (-0.225, 2.6410225293, (0.2410225293, 1.2239656284, 2.0379136045)),
        (0.225, 3.3203915432, (0.9203915432, 1.5123229129, 2.9986864779)),
    ],
)
def test_rest_lengths(area_change, side, lengths):
    material = Material()
    assert material.actuated_side(area_change) == pytest.approx(side, abs=1e-9)
    assert material.rest_lengths(side) == pytest.approx(lengths, abs=1e-9)


def test_actuated_side_scales_the_area():
    material = Material(side=2.0)
    assert material.actuated_side(0.21) == pytest.approx(2.2)


@pytest.mark.parametrize('name', FIELDS)
def test_range_is_inclusive_and_declared_with_the_constant(name):
    meta = FIELDS[name].metadata
    assert meta['text']
    assert meta['low'] <= FIELDS[name].default <= meta['high']
    for value in (meta['low'], meta['high']):
        assert getattr(Material(**{name: value}), name) == value
    beyond = math.nextafter(meta['high'], math.inf), math.nextafter(meta['low'], -math.inf)
    for value in (*beyond, math.nan, math.inf, -math.inf, True, '1', None, [1.0]):
        with pytest.raises(InvalidInput, match=rf'material\.{name}'):
            Material(**{name: value})


def test_integers_are_valid_numbers():
    assert Material(side=3) == Material()


def test_from_dict():
    assert Material.from_dict({}) == Material()
    assert Material.from_dict({'gravity': 1.6}) == Material(gravity=1.6)
    with pytest.raises(InvalidInput, match=r"got 'gravty', expected .*did you mean 'gravity'"):
        Material.from_dict({'gravty': 1.6})
    with pytest.raises(InvalidInput, match=r'material\.gravity'):
        Material.from_dict({'gravity': -1})


def test_material_is_immutable():
    with pytest.raises(dataclasses.FrozenInstanceError):
        Material().side = 2.0
