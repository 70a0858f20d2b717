"""Poses read from markers, which carry no control step, and walks recorded without ROS."""

from dataclasses import replace

import numpy as np
import pytest
from support.synthetic_bag import TYPES, make_walk, markers, messages_of_walk, write_messages

from sim_node.model.morphology import parse_morphology
from sim_node.model.physics import PHYSICS
from sim_node.model.solver import Solver
from sim_node.simulation import Simulation
from snca_ros.cell.architecture import Architecture
from snca_ros.evolution.episode import run_episode
from snca_ros.faults import parse_faults
from snca_ros.recording.bag import read_bag
from snca_ros.recording.offline import record_offline, replayed_thresholds
from snca_ros.trained_controller import TrainedController

GROUND = np.array([[0.0, 5.0], [7.0, 6.0], [20.0, 5.0]])


def moving_walk(n_steps=21, seed=0):
    walk = make_walk(n_steps, seed=seed)
    corners = np.random.default_rng(seed).normal(size=(n_steps + 1, 2, 4, 2))
    return replace(walk, corners=corners, ground=GROUND)


def test_poses_are_those_published(tmp_path):
    walk = moving_walk()
    poses = read_bag(write_messages(tmp_path / 'bag', messages_of_walk(walk))).poses
    np.testing.assert_array_equal(poses.steps, np.arange(0, 22, 2))
    np.testing.assert_array_equal(poses.corners, walk.corners[::2])
    np.testing.assert_array_equal(poses.ground, GROUND)


def test_lost_poses_leave_the_others_in_their_place(tmp_path):
    walk = moving_walk()
    messages = messages_of_walk(walk)
    for k in (6, 12):
        messages[k] = [m for m in messages[k] if not m[0].endswith('/markers')]
    poses = read_bag(write_messages(tmp_path / 'bag', messages)).poses
    np.testing.assert_array_equal(poses.steps, [0, 2, 4, 8, 10, 14, 16, 18, 20])
    np.testing.assert_array_equal(poses.corners, walk.corners[poses.steps])


def test_each_episode_has_its_own_poses(tmp_path):
    walks = moving_walk(9, seed=1), moving_walk(15, seed=2)
    messages = [step for walk in walks for step in messages_of_walk(walk)]
    bag = write_messages(tmp_path / 'bag', messages)
    for episode, walk in enumerate(walks):
        poses = read_bag(bag, episode).poses
        np.testing.assert_array_equal(poses.corners, walk.corners[::2])


def test_markers_of_other_nodes_are_ignored(tmp_path):
    walk = moving_walk()
    messages = messages_of_walk(walk)
    messages[5].append(('/biped/markers', markers({'voxels': np.ones((5, 2))})))
    messages[7].append(('/biped/markers', TYPES['visualization_msgs/msg/MarkerArray']([])))
    poses = read_bag(write_messages(tmp_path / 'bag', messages)).poses
    np.testing.assert_array_equal(poses.corners, walk.corners[::2])


@pytest.mark.parametrize('before', [{}, {'outlines': np.ones((4, 2))}])
def test_poses_may_follow_another_marker_and_be_repeated(tmp_path, before):
    walk = moving_walk()
    triangles = walk.corners[:, :, [0, 1, 2, 0, 2, 3]].reshape(len(walk.corners), -1, 2)
    messages = [
        [(topic, m) for topic, m in step if not topic.endswith('/markers')]
        for step in messages_of_walk(walk)
    ]
    messages[0].append(('/biped/markers', markers({'ground': GROUND})))
    for k in range(0, 22, 2):
        shown = {**before, 'voxels': triangles[min(k, 10)]}
        messages[k].append(('/biped/markers', markers(shown)))
    poses = read_bag(write_messages(tmp_path / 'bag', messages)).poses
    np.testing.assert_array_equal(poses.corners, walk.corners[np.minimum(poses.steps, 10)])


def test_a_bag_whose_markers_show_nothing_has_no_poses(tmp_path):
    bag = write_messages(tmp_path / 'bag', messages_of_walk(make_walk(5)))
    assert read_bag(bag).poses is None


def trained_controller(model='snn-h', **options):
    architecture = Architecture.named('U-nD', model, **options)
    morphology = parse_morphology('11-10')
    theta = np.random.default_rng(0).uniform(-1, 1, architecture.n_parameters(3))
    return TrainedController(architecture, morphology, theta)


@pytest.mark.parametrize('physics', PHYSICS)
@pytest.mark.parametrize('model', ['snn-h', 'snn', 'mlp'])
def test_an_offline_walk_is_the_episode(tmp_path, model, physics):
    trained = replace(trained_controller(model), solver=Solver(physics=physics))
    recording, thresholds = record_offline(trained, tmp_path, 1.0, 'hilly-1-10-0')
    simulation = Simulation('11-10', 'hilly-1-10-0', solver=trained.solver)
    episode = run_episode(simulation, trained.controller(), 1.0)
    assert recording.physics == physics
    np.testing.assert_array_equal(recording.centers, episode.centers)
    assert recording.heard.sum() == 60 * 3
    assert (recording.spikes is None) == (model == 'mlp')
    assert (recording.values is None) == (model != 'mlp')
    assert (thresholds is None) == (model == 'mlp')


@pytest.mark.parametrize('as_printed', [False, True])
def test_thresholds_of_a_recorded_walk_are_reproduced(tmp_path, as_printed):
    trained = trained_controller(as_printed=as_printed)
    recording, thresholds = record_offline(trained, tmp_path, 1.0)
    found = replayed_thresholds(recording, trained)
    np.testing.assert_array_equal(found, thresholds)
    assert np.isfinite(found[:60]).all()
    assert np.ptp(found[:60]) > 0.0


def test_thresholds_end_where_the_walk_was_disturbed(tmp_path):
    trained = trained_controller()
    recording, _ = record_offline(trained, tmp_path, 1.0, faults=parse_faults('death=1@0.5'))
    known = np.isfinite(replayed_thresholds(recording, trained)).all(axis=1)
    assert known[:30].all()
    assert not known[30:].any()
