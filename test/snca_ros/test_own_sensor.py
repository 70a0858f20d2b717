"""Sensors from outside the tree: found by name, read by both engines, evolved, saved, recorded."""

import math
import os
import subprocess
import sys

import numpy as np
import pytest
import yaml
from support.limits import LIMIT
from support.paths import ROOT
from support.synthetic_bag import make_walk, messages_of_walk, write_messages
from support.tilt_sensor import Height, Turned

from sim_node.batched.engine import Robots
from sim_node.errors import InvalidInput
from sim_node.model.sensors import DEFAULT_SENSORS, SENSORS
from sim_node.registry import PLUGINS
from sim_node.simulation import Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import load_controller
from snca_ros.evolution.checkpoint import RunFolder
from snca_ros.evolution.config import RunConfig
from snca_ros.evolution.evolve import evolve
from snca_ros.evolution.workers import IN_PROCESS
from snca_ros.recording.bag import read_bag
from snca_ros.recording.offline import record_offline
from snca_ros.rendering.film import film_recording
from snca_ros.web.frames import make_frames

FIVE = (*DEFAULT_SENSORS, 'tilt')
BLIND = ('tilt', 'velocity_x')  # neither area nor touch
ENGINES = ('pymunk', 'batched')


@pytest.fixture(autouse=True)
def registered():
    SENSORS['tilt'] = Turned()
    SENSORS['height'] = Height()
    yield
    del SENSORS['tilt'], SENSORS['height']


def actuation(n_voxels, step):
    return np.sin(0.2 * step + np.arange(n_voxels))


def walk(n_steps=40, shape='11-10', **options):
    """Return the readings after each step, and the masses from the start on."""
    simulation = Simulation(shape, **options)
    readings, masses = [simulation.reset()], [simulation.world.masses.copy()]
    for k in range(n_steps):
        readings.append(simulation.step(actuation(simulation.morphology.n_voxels, k)))
        masses.append(simulation.world.masses.copy())
    return np.array(readings), np.array(masses)


def sines(masses):
    """Return the sine of each voxel's rotation at each step, (n, n_voxels)."""
    corners = masses[..., :2].reshape(len(masses), -1, 4, 2)  # NW, NE, SE, SW
    sides = [corners[:, :, 1] - corners[:, :, 0], corners[:, :, 2] - corners[:, :, 3]]
    axis = sum(side / np.hypot(side[..., :1], side[..., 1:]) for side in sides)
    return np.sin(np.arctan2(axis[..., 1], axis[..., 0]))


@pytest.mark.parametrize('engine', ENGINES)
def test_a_fifth_sensor_is_what_numpy_computes_from_the_masses(engine):
    readings, masses = walk(engine=engine, sensors=FIVE)
    assert readings.shape == (41, 3, 5)
    measured = sines(masses)
    means = np.array([measured[max(0, k - 2) : k + 1].mean(axis=0) for k in range(41)])
    np.testing.assert_allclose(readings[..., 4], np.tanh(2.0 * means) / 2.0 + 0.5, atol=1e-12)
    assert np.ptp(readings[..., 4]) > 0.01
    four, _ = walk(engine=engine)
    np.testing.assert_array_equal(readings[..., :4], four)


@pytest.mark.parametrize('engine', ENGINES)
def test_a_sensor_without_a_range_is_clipped(engine):
    readings, masses = walk(engine=engine, sensors=('height',))
    heights = masses[..., 1].reshape(41, -1, 4).mean(axis=2) / 10.0
    assert readings.shape == (41, 3, 1)
    np.testing.assert_allclose(readings[..., 0], np.minimum(heights, 1.0), atol=1e-12)
    assert (heights > 1.0).any()
    assert (heights < 1.0).any()


@pytest.mark.parametrize('width', [4, 8])
@pytest.mark.parametrize('sensors', [FIVE, BLIND, ('height', 'tilt')], ids='+'.join)
def test_a_lane_is_the_robot_alone(width, sensors):
    alone, _ = walk(engine='batched', sensors=sensors)
    like = Simulation('11-10')
    robots = Robots(
        like.morphology, like.terrain, like.material, like.solver, width, sensors=sensors
    )
    seen = [robots.readings]
    for k in range(40):
        values = np.zeros((3, width))
        values[:, 1:] = actuation(3, k)[:, None]
        seen.append(robots.step(values))
    for lane in range(1, width):
        np.testing.assert_array_equal(np.array(seen)[..., lane], alone)
    assert not np.array_equal(np.array(seen)[..., 0], alone)
    assert robots.sane.all()


@pytest.mark.parametrize('engine', ENGINES)
def test_faults_of_the_first_four_do_not_depend_on_the_fifth(engine):
    faults = {'sensor_noise': 0.05, 'broken_sensors': 'random:0.7@0.1', 'seed': 3}
    five, _ = walk(engine=engine, sensors=FIVE, **faults)
    four, _ = walk(engine=engine, **faults)
    np.testing.assert_array_equal(five[..., :4], four)
    reversed_, _ = walk(engine=engine, sensors=FIVE[::-1])
    sound, _ = walk(engine=engine, sensors=FIVE)
    np.testing.assert_array_equal(reversed_[..., ::-1], sound)
    noise = five[:6] - sound[:6]
    assert (noise[..., 4] != 0.0).all()
    assert not np.isclose(noise[..., 4:], noise[..., :4]).any()
    broken = (five[7:, :, 4] != five[6:-1, :, 4]).all(axis=0)
    assert broken.all()
    assert len(np.unique(five[10:])) > 0.9 * five[10:].size


def test_disturbances_of_five_sensors_are_the_same_drawn_at_once():
    options = {'sensor_noise': 0.5, 'broken_sensors': 'random:0.5@0.05', 'sensors': FIVE}
    a, b = (Simulation('11-10', **options) for _ in range(2))
    many, rows = a.disturbance(20), []
    for k in range(20):
        b.step_count = k
        rows.append(b.disturbance(1))
    for part, single in zip(many, zip(*rows, strict=True), strict=True):
        np.testing.assert_array_equal(part, np.concatenate(single))
    assert many.noise.shape == many.sensors.shape == (20, 3, 5)


@pytest.mark.parametrize(('engine', 'model'), [('pymunk', 'snn-h'), ('batched', 'mlp')])
def test_it_is_evolved_saved_loaded_and_recorded(tmp_path, engine, model):
    cell = Architecture.named('U-nD', model, sensors=FIVE)
    config = RunConfig(
        '11-10', cell, engine=engine, episodes=14, population=6, duration=1.0, transient=0.2
    )
    assert 'sensors-area+touch+velocity_x+velocity_y+tilt' in config.name
    assert 'hidden' not in config.name
    folder = RunFolder.create(tmp_path / 'run', config)
    evolve(folder, IN_PROCESS)
    folder.close()
    written = yaml.safe_load((tmp_path / 'run' / 'config.yaml').read_text())
    assert written['architecture']['sensors'] == list(FIVE)
    assert RunConfig.from_yaml(tmp_path / 'run' / 'config.yaml') == config
    trained = load_controller(tmp_path / 'run' / 'best.npz')
    assert trained.architecture == cell
    assert len(trained.parameters) == config.n_parameters == cell.n_parameters(3)
    recording, _ = record_offline(trained, tmp_path, 0.5)
    assert recording.sensors == FIVE
    assert recording.readings.shape == (31, 3, 5)
    simulation = trained.simulation()
    np.testing.assert_array_equal(recording.readings[0], simulation.readings)
    frames = make_frames(recording)
    assert (frames.arrays['area'].raw < 255).mean() > 0.9
    fitness = trained.scores[engine]
    assert fitness == trained.fitness
    assert math.isfinite(fitness)


def test_what_shows_area_and_touch_does_without_them(tmp_path):
    walked = make_walk(8)
    names = {'sensors': BLIND, 'readings': walked.readings[..., :2]}
    corners = np.random.default_rng(0).normal(size=(9, 2, 4, 2))
    ground = np.array([[-9.0, 5.0], [9.0, 5.0]])
    messages = messages_of_walk(make_walk(8, corners=corners, ground=ground, **names))
    recording = read_bag(write_messages(tmp_path / 'bag', messages))
    assert recording.sensors == BLIND
    np.testing.assert_array_equal(recording.readings[:8], walked.readings[..., :2])
    frames = make_frames(recording)
    assert (frames.arrays['area'].raw == 255).all()
    assert (frames.arrays['touch'].raw == 255).all()
    assert np.isfinite(film_recording(recording, np.array([0.0, 0.1])).colors).all()


def test_voxels_of_a_bag_that_sense_different_things_are_refused(tmp_path):
    one, two = (
        messages_of_walk(make_walk(4, (name,), sensors=sensors))
        for name, sensors in (('voxel_0_0', DEFAULT_SENSORS), ('voxel_1_0', DEFAULT_SENSORS[::-1]))
    )
    of_voxel = [[m for m in said if 'voxel' in m[0]] for said in two]
    bag = write_messages(tmp_path / 'bag', [*one, *of_voxel])
    with pytest.raises(InvalidInput, match='the same names in all voxels'):
        read_bag(bag)


def test_the_command_takes_sensors_of_a_plug_in(tmp_path):
    path = os.pathsep.join([str(ROOT), str(ROOT / 'test')])
    command = [
        sys.executable, '-m', 'snca_ros', 'evolve', '--shape', '11', '--sensors', 'tilt,area',
        '--neuron-model', 'mlp', '--episodes', '4', '--population', '4', '--duration', '0.2',
        '--transient', '0',
    ]

    def run(**plugins):
        environment = {**os.environ, 'PYTHONPATH': path, **plugins}
        return subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=False,
            timeout=LIMIT,
        )

    refused = run()
    assert refused.returncode != 0
    known = "sensors: got 'tilt', expected one of area, touch, velocity_x, velocity_y"
    assert known in refused.stderr
    done = run(**{PLUGINS: 'support.tilt_plugin'})
    assert done.returncode == 0, done.stderr
    assert 'sensors tilt, area' in done.stderr
    best, = tmp_path.glob('runs/*sensors-tilt+area*/best.npz')
    assert load_controller(best).architecture.sensors == ('tilt', 'area')
