import math
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_node.errors import InvalidInput
from sim_node.model.sensing import add_noise, sense_robot, sensing_of_one
from sim_node.model.sensors import (
    DEFAULT_SENSORS,
    SENSORS,
    SensorRegistry,
    Voxel,
    check_sensors,
    outer_corners,
    own_velocity,
    polygon_area,
    soft_normalise,
)
from sim_node.numerics.jit import compiled_inline

SQUARE = ((-0.9, 0.9), (0.9, 0.9), (0.9, -0.9), (-0.9, -0.9))


def voxel(angle=0.0, velocity=(0.0, 0.0), corners=SQUARE):
    """Return the rows of a voxel turned by `angle` [rad] about (20, 7)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([
        (20 + c * x - s * y, 7 + s * x + c * y, angle, *velocity) for x, y in corners
    ])


def seen(masses):
    """Return the voxel of these rows."""
    return Voxel(*(tuple(masses[:, j]) for j in (0, 1, 3, 4)), 1.0, 0.0)


def test_names_and_constants():
    assert tuple(SENSORS) == DEFAULT_SENSORS == ('area', 'touch', 'velocity_x', 'velocity_y')
    constants = [SENSORS[name]._asdict() for name in DEFAULT_SENSORS]
    assert constants == [
        {'window': 1, 'low': 0.5, 'high': 1.5}, {'window': 15},
        {'window': 30, 'low': -8.0, 'high': 8.0}, {'window': 30, 'low': -8.0, 'high': 8.0},
    ]


def test_soft_normalisation_of_the_area():
    # tanh(2 x) / 2 + 1 / 2 is the logistic function of 4 x.
    for ratio, exponent in ((0.5, 4.0), (0.775, 1.8), (1.0, 0.0), (1.225, -1.8), (1.5, -4.0)):
        expected = 1.0 / (1.0 + math.exp(exponent))
        assert soft_normalise(ratio, 0.5, 1.5) == pytest.approx(expected, rel=1e-12)


@given(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6))
def test_soft_normalisation_stays_in_range_and_grows(a, b):
    low, high = sorted((a, b))
    smaller, larger = soft_normalise(low, -8.0, 8.0), soft_normalise(high, -8.0, 8.0)
    assert 0.0 <= smaller <= larger + 1e-15 <= 1.0 + 1e-15


def test_soft_normalisation_of_velocity():
    for v, expected in ((0.0, 0.5), (8.0, 0.98201379004), (-4.0, 0.11920292202)):
        assert soft_normalise(v, -8.0, 8.0) == pytest.approx(expected, abs=1e-10)


def test_area_of_known_polygons():
    # Shoelace by hand: -(0*2-4*3) - (4*0-3*2) - (3*(-1)-1*0) - (1*3-0*(-1)) = 18, halved.
    polygon = np.array([(0.0, 3.0), (4.0, 2.0), (3.0, 0.0), (1.0, -1.0)])
    assert polygon_area(polygon) == pytest.approx(9.0)
    assert polygon_area(polygon - 100.0) == pytest.approx(9.0)
    assert polygon_area(polygon[::-1].copy()) == pytest.approx(-9.0)
    assert polygon_area(np.array([(0.0, 3.0), (3.0, 3.0), (3.0, 0.0), (0.0, 0.0)])) == 9.0


def test_outer_corners():
    corners = np.zeros((4, 2))
    outer_corners(voxel(), 0.6, corners)
    assert corners == pytest.approx(np.array([(18.5, 8.5), (21.5, 8.5), (21.5, 5.5), (18.5, 5.5)]))
    outer_corners(voxel(math.pi / 2), 0.6, corners)
    assert corners == pytest.approx(np.array([(18.5, 5.5), (18.5, 8.5), (21.5, 8.5), (21.5, 5.5)]))


def test_each_mass_turns_its_own_corner():
    masses = voxel()
    masses[0, 2] = math.pi / 4  # its corner now points straight to the left
    corners = np.zeros((4, 2))
    outer_corners(masses, 0.6, corners)
    assert corners[0] == pytest.approx((19.1 - 0.6 * math.sqrt(2), 7.9))
    assert corners[1] == pytest.approx((21.5, 8.5))


@pytest.mark.parametrize(
    ('angle', 'velocity', 'own'),
    [
        (0.0, (1.0, 2.0), (1.0, 2.0)),
        (90.0, (1.0, 2.0), (2.0, -1.0)),
        (180.0, (1.0, 2.0), (-1.0, -2.0)),
        (-90.0, (1.0, 2.0), (-2.0, 1.0)),
        (30.0, (1.0, 0.0), (math.sqrt(0.75), -0.5)),
        (750.0, (1.0, 0.0), (math.sqrt(0.75), -0.5)),
    ],
)
def test_velocity_in_own_axes(angle, velocity, own):
    assert own_velocity(seen(voxel(math.radians(angle), velocity))) == pytest.approx(own)


def test_own_axes_are_the_mean_of_top_and_bottom():
    top, low = math.radians(30), math.radians(-10)
    masses = np.zeros((4, 5))
    masses[1, :2] = 2 * math.cos(top), 2 * math.sin(top)  # NE seen from NW
    masses[3, :2] = 0.0, -2.0
    masses[2, :2] = 0.5 * math.cos(low), -2.0 + 0.5 * math.sin(low)  # SE seen from SW
    masses[:, 3] = 1.0
    mean = math.radians(10)
    assert own_velocity(seen(masses)) == pytest.approx((math.cos(mean), -math.sin(mean)))


def test_velocity_is_the_mean_of_the_masses():
    masses = voxel()
    masses[:, 3] = 1.0, 2.0, 3.0, 6.0
    masses[:, 4] = 4.0, -4.0, 0.0, 2.0
    assert own_velocity(seen(masses)) == pytest.approx((3.0, 0.5))


def reading_of(measure):
    return math.tanh(measure / 4.0) / 2.0 + 0.5


def test_mean_of_the_first_steps_counts_only_what_passed():
    robot = sensing_of_one(('velocity_x', 'touch'), 1)
    found = []
    for step, value in enumerate((3.0, 1.0, 2.0, 6.0)):
        sense_robot(robot, voxel(0.0, (value, 0.0)), np.ones(1), np.array([step % 2.0]), step)
        found.append(robot.readings[0].tolist())
    assert [touch for _, touch in found] == pytest.approx([0.0, 0.5, 1 / 3, 0.5])
    assert [v for v, _ in found] == pytest.approx([reading_of(v) for v in (3.0, 2.0, 2.0, 3.0)])


@pytest.mark.parametrize('names', [
    DEFAULT_SENSORS, DEFAULT_SENSORS[::-1], ('velocity_y',), ('touch', 'area', 'velocity_x'),
])
def test_readings_over_many_steps(names):
    rng = np.random.default_rng(5)
    touching = rng.integers(0, 2, 100).astype(float)
    speeds = rng.normal(0.0, 6.0, (100, 2))
    areas = rng.uniform(0.6, 1.4, 100)
    robot = sensing_of_one(names, 2)
    rest = np.tile(voxel(), (2, 1))
    for k in range(100):
        masses = rest.copy()
        masses[4:] = voxel(math.pi / 2, speeds[k])
        assert sense_robot(
            robot, masses, np.array([1.0, areas[k]]), np.array([0.0, touching[k]]), k
        )
        along = speeds[max(0, k - 29) : k + 1, 1].mean()  # turned by 90 degrees: x' = y, y' = -x
        across = -speeds[max(0, k - 29) : k + 1, 0].mean()
        expected = {
            'area': math.tanh(4 * (areas[k] - 1.0)) / 2 + 0.5,
            'touch': touching[max(0, k - 14) : k + 1].mean(),
            'velocity_x': reading_of(along),
            'velocity_y': reading_of(across),
        }
        assert robot.readings[1] == pytest.approx([expected[name] for name in names], abs=1e-12)
        assert robot.readings[0].tolist() == [0.0 if name == 'touch' else 0.5 for name in names]


def test_a_physics_that_diverged_is_told():
    robot = sensing_of_one(DEFAULT_SENSORS, 1)

    def sane(masses, ratio=1.0):
        return bool(sense_robot(robot, masses, np.array([ratio]), np.zeros(1), 0))

    assert sane(voxel())
    assert sane(voxel(), -99.0)
    assert not sane(voxel(), 100.0)
    assert not sane(voxel(), math.nan)
    fast = voxel()
    fast[2, 4] = math.nan
    assert not sane(fast)
    assert sane(voxel())


class Odd(NamedTuple):
    window: int = 1
    low: float = 0.0
    high: float = 1.0

    @staticmethod
    @compiled_inline
    def measure(sensor, voxel):
        return voxel.touching


class NotCompiled(NamedTuple):
    window: int = 1

    @staticmethod
    def measure(sensor, voxel):
        return voxel.touching


class Area(NamedTuple):
    """Another class than that of 'area', with its name."""

    window: int = 1
    measure = Odd.measure


class OneEnd(NamedTuple):
    window: int = 1
    high: float = 1.0
    measure = Odd.measure


class Named(NamedTuple):
    window: int = 1
    unit: str = 'm'
    measure = Odd.measure


@pytest.mark.parametrize(('thing', 'named'), [
    (object(), 'odd: got .*a named tuple'), (Odd.measure, 'odd: got .*a named tuple'),
    (NotCompiled(), 'compiled method'), (Named(), 'int and float'),
    (Odd(0), r'odd\.window: got 0'), (Odd(1.0), r'odd\.window'), (Odd(3601), r'1 to 3600'),
    (Odd(True), 'int and float'), (Odd(1, 2.0, 2.0), 'a higher `high`'),
    (Odd(1, 2.0, 1.0), 'a higher `high`'), (Odd(1, math.nan, 1.0), 'a higher `high`'),
    (OneEnd(), 'or neither'),
    (Area(), r'another class name: sim_node\.model\.sensors has defined a class'),
])
def test_what_is_no_sensor_is_refused(thing, named):
    with pytest.raises(InvalidInput, match=named):
        SENSORS.register('odd', thing)
    assert 'odd' not in SENSORS


@pytest.mark.parametrize('name', ['', 'a,b', 'a-b', 'a/b', '1a', None, 'a b'])
def test_a_name_must_fit_into_lists_and_folder_names(name):
    with pytest.raises(InvalidInput, match='letters, digits and _'):
        SENSORS.register(name, Odd())


def test_one_class_can_be_several_sensors():
    registry = SensorRegistry('sensors', {'slow': Odd(30)})
    registry['fast'] = Odd(2)
    assert registry['fast'].window == 2
    assert list(registry) == ['slow', 'fast']


@pytest.mark.parametrize(
    'names', [(), 'area', None, ('area', 'area'), ('area', 'aera'), (3,), [[]]]
)
def test_a_list_of_sensors_that_is_none(names):
    with pytest.raises(InvalidInput, match='sensors'):
        check_sensors(names)


def test_noise_is_added_and_clipped():
    readings = np.array([[0.5, 0.9, 0.1, 1.0]])
    add_noise(readings, np.array([[0.25, 0.2, -0.3, -0.5]]))
    assert readings.tolist() == [[0.75, 1.0, 0.0, 0.5]]
    add_noise(readings, np.zeros((0, 4)))
    assert readings.tolist() == [[0.75, 1.0, 0.0, 0.5]]
