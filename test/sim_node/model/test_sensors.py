import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sim_node.model.sensors import (
    N_SENSORS,
    SENSORS,
    TOUCH_WINDOW,
    VELOCITY_WINDOW,
    add_noise,
    measure,
    normalise,
    outer_corners,
    own_velocity,
    polygon_area,
    sample_windows,
    soft_normalise,
    window_means,
)

SQUARE = ((-0.9, 0.9), (0.9, 0.9), (0.9, -0.9), (-0.9, -0.9))


def voxel(angle=0.0, velocity=(0.0, 0.0), corners=SQUARE):
    """Return the rows of a voxel turned by `angle` [rad] about (20, 7)."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([
        (20 + c * x - s * y, 7 + s * x + c * y, angle, *velocity) for x, y in corners
    ])


def columns(masses):
    """Return x, y, v_x and v_y of the rows."""
    return masses[:, [0, 1, 3, 4]].T


def test_names():
    assert SENSORS == ('area', 'touch', 'velocity_x', 'velocity_y')
    assert N_SENSORS == 4
    assert (TOUCH_WINDOW / 60, VELOCITY_WINDOW / 60) == (0.25, 0.5)


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
    assert own_velocity(*columns(voxel(math.radians(angle), velocity))) == pytest.approx(own)


def test_own_axes_are_the_mean_of_top_and_bottom():
    top, low = math.radians(30), math.radians(-10)
    masses = np.zeros((4, 5))
    masses[1, :2] = 2 * math.cos(top), 2 * math.sin(top)  # NE seen from NW
    masses[3, :2] = 0.0, -2.0
    masses[2, :2] = 0.5 * math.cos(low), -2.0 + 0.5 * math.sin(low)  # SE seen from SW
    masses[:, 3] = 1.0
    mean = math.radians(10)
    assert own_velocity(*columns(masses)) == pytest.approx((math.cos(mean), -math.sin(mean)))


def test_velocity_is_the_mean_of_the_masses():
    masses = voxel()
    masses[:, 3] = 1.0, 2.0, 3.0, 6.0
    masses[:, 4] = 4.0, -4.0, 0.0, 2.0
    assert own_velocity(*columns(masses)) == pytest.approx((3.0, 0.5))


def test_window_mean_of_the_first_steps_counts_only_what_passed():
    windows = np.zeros((2, 4))
    means = []
    for step, value in enumerate((3.0, 1.0, 2.0, 6.0, 7.0, 1.0)):
        windows[:, step % 4] = value, -2.0 * value
        means.append(window_means(windows, step))
    assert [first for first, _ in means] == [3.0, 2.0, 2.0, 3.0, 4.0, 4.0]
    assert [second for _, second in means] == [-6.0, -4.0, -4.0, -6.0, -8.0, -8.0]


def test_readings_over_many_steps():
    rng = np.random.default_rng(5)
    touching = rng.integers(0, 2, 100).astype(float)
    speeds = rng.normal(0.0, 6.0, (100, 2))
    areas = rng.uniform(0.6, 1.4, 100)
    touches, velocities = sample_windows(2)
    readings = np.zeros((2, 4))
    for k in range(100):
        rows = voxel(math.pi / 2, speeds[k])
        measure(rows, k, touching[k], areas[k], touches[1], velocities[1], readings[1])
        normalise(readings[1])
        along = speeds[max(0, k - 29) : k + 1, 1].mean()  # turned by 90 degrees: x' = y, y' = -x
        across = -speeds[max(0, k - 29) : k + 1, 0].mean()
        assert readings[1] == pytest.approx([
            math.tanh(4 * (areas[k] - 1.0)) / 2 + 0.5,
            touching[max(0, k - 14) : k + 1].mean(),
            math.tanh(along / 4) / 2 + 0.5,
            math.tanh(across / 4) / 2 + 0.5,
        ], abs=1e-12)
    assert not touches[0].any()
    assert not readings[0].any()


def test_noise_is_added_and_clipped():
    readings = np.array([[0.5, 0.9, 0.1, 1.0]])
    add_noise(readings, np.array([[0.25, 0.2, -0.3, -0.5]]))
    assert readings.tolist() == [[0.75, 1.0, 0.0, 0.5]]
    add_noise(readings, np.zeros((0, 4)))
    assert readings.tolist() == [[0.75, 1.0, 0.0, 0.5]]
