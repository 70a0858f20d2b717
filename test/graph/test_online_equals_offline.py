"""A lock-step run of the graph equals the offline episode bit for bit."""

import numpy as np
import pytest
from support.limits import LIMIT
from support.paths import ROOT

from sim_node.registry import PLUGINS
from sim_node.simulation import Simulation
from snca_ros.controller_file import load_controller
from snca_ros.faults import Faults, parse_faults
from snca_ros.graph.description import WalkOptions, describe_graph
from snca_ros.graph.processes import RunningGraph
from snca_ros.recording.bag import read_bag
from snca_ros.recording.outcomes import Outcome

DURATION = 2.0
NONE = Faults()
N_STEPS = 120
COMBINATIONS = [
    (name, model) for name in ('U-nD', 'U-D', 'nU-D') for model in ('mlp', 'snn', 'snn-h')
]


def offline(path, terrain='flat', engine='pymunk', faults=NONE):
    """Step the offline twins in Python; return centres, readings, actuation and messages."""
    trained = load_controller(path)
    simulation = Simulation(trained.morphology, terrain, engine=engine, **faults.of_body)
    controller = trained.controller(faults)
    readings = simulation.reset()
    centers, all_readings, actuations, messages = [simulation.center], [], [], []
    for _ in range(N_STEPS):
        actuation = controller.step(readings)
        all_readings.append(readings)
        actuations.append(actuation)
        messages.append(controller.cells.outbox.copy())
        readings = simulation.step(actuation)
        centers.append(simulation.center)
    return tuple(map(np.array, (centers, all_readings, actuations, messages)))


def walk(path, bag, voxels_per_process, terrain='flat', engine='', faults=NONE):
    """Run the graph and return the recording of its bag."""
    options = WalkOptions(
        duration=DURATION, voxels_per_process=voxels_per_process, bag=str(bag), terrain=terrain,
        engine=engine, faults=faults,
    )
    graph = describe_graph(path, load_controller(path), options)
    with RunningGraph(graph, {}) as running:
        assert running.wait(graph.simulation, LIMIT) == 0
    return read_bag(bag)


@pytest.mark.parametrize('voxels_per_process', [1, 1000], ids=['each-alone', 'all-in-one'])
@pytest.mark.parametrize(('name', 'model'), COMBINATIONS)
def test_graph_repeats_the_offline_episode(
    make_controller, tmp_path, name, model, voxels_per_process
):
    path = make_controller('11-10', name, model)
    centers, readings, actuation, messages = offline(path)
    recording = walk(path, tmp_path / 'bag', voxels_per_process)
    assert {count.topic: count.lost for count in recording.counts if count.lost} == {}
    np.testing.assert_array_equal(recording.centers, centers)
    np.testing.assert_array_equal(recording.readings[:N_STEPS], readings)
    np.testing.assert_array_equal(recording.actuation[:N_STEPS], actuation)
    np.testing.assert_array_equal(recording.applied[:N_STEPS], actuation)
    assert (recording.outcomes[:N_STEPS] == Outcome.IN_TIME).all()
    assert recording.heard[:N_STEPS].all()
    sent = messages.reshape(N_STEPS, 3, -1, messages.shape[-1])
    if model == 'mlp':
        np.testing.assert_array_equal(recording.values[:N_STEPS], sent[..., 0])
    else:
        np.testing.assert_array_equal(recording.spikes[:N_STEPS], sent)
    assert np.abs(sent).sum() > 0
    assert len(np.unique(actuation)) > 1


def test_hilly_terrain_too(make_controller, tmp_path):
    path = make_controller('11-10', 'U-D', 'mlp', seed=3)
    centers, *_ = offline(path, 'hilly-1-10-0')
    recording = walk(path, tmp_path / 'bag', 2, 'hilly-1-10-0')
    np.testing.assert_array_equal(recording.centers, centers)


def test_batched_engine_too(make_controller, tmp_path):
    path = make_controller('11-10', 'U-nD', 'snn-h', seed=4)
    centers, readings, *_ = offline(path, 'uphill-10', 'batched')
    recording = walk(path, tmp_path / 'bag', 2, 'uphill-10', 'batched')
    np.testing.assert_array_equal(recording.centers, centers)
    np.testing.assert_array_equal(recording.readings[:N_STEPS], readings)
    in_pymunk, *_ = offline(path, 'uphill-10')
    assert not np.array_equal(in_pymunk, centers)


@pytest.mark.parametrize(('name', 'model', 'engine', 'text'), [
    ('U-nD', 'snn-h', 'pymunk',
     'loss=0.2,delay=2,death=0.7@0.5-1,broken_sensors=random:0.4@0.3-1.5,'
     'broken_actuators=frozen:voxel_0_0@1.2,sensor_noise=0.05,seed=7'),
    ('nU-D', 'mlp', 'batched',
     'loss=0.4,death=voxel_1_1@0.2-0.6,broken_sensors=frozen:0.7@0.5,'
     'broken_actuators=random:1@0-1.1,seed=8'),
])
def test_faulty_graph_repeats_its_offline_episode(
    make_controller, tmp_path, name, model, engine, text
):
    path, faults = make_controller('11-10', name, model, seed=5), parse_faults(text)
    centers, readings, actuation, messages = offline(path, engine=engine, faults=faults)
    recording = walk(path, tmp_path / 'bag', 2, engine=engine, faults=faults)
    np.testing.assert_array_equal(recording.centers, centers)
    np.testing.assert_array_equal(recording.readings[:N_STEPS], readings)
    np.testing.assert_array_equal(recording.actuation[:N_STEPS], actuation)
    sent = recording.values if model == 'mlp' else recording.spikes
    np.testing.assert_array_equal(sent[:N_STEPS].ravel(), messages.ravel())
    assert not np.array_equal(offline(path, engine=engine)[0], centers)


@pytest.mark.parametrize('model', ['snn-h', 'mlp'])
def test_without_compiled_messages_too(start, make_controller, monkeypatch, model):
    monkeypatch.setenv(PLUGINS, 'support.without_rcl')
    path = make_controller('11-10', 'U-D', model)
    child = start('walk', path, '--duration', 1, '--bag', 'bag', path=[ROOT / 'test'])
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0, output
    assert '61 positions of the centre, bit for bit the same' in output
