"""The files for RViz and Foxglove: all that they name is there in a recorded walk, as they take it.

Neither program runs here. What they need is held against a bag of the biped: topics, types and
QoS, namespaces of markers, frames, and every plotted path down to its number.
"""

import json
import os
import re
import subprocess
import sys

import numpy as np
import pytest
import yaml
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.rosbag2 import Reader
from rosbags.typesys import Stores, get_typestore
from support.limits import LIMIT
from support.paths import ROOT

from snca_ros.bundled import find_controller
from snca_ros.controller_file import load_controller
from snca_ros.graph.child_process import PARENT
from snca_ros.rendering.film import film_bag, film_offline

CONFIG = ROOT / 'config'
STORE = get_typestore(Stores.ROS2_JAZZY)
IMAGE, MARKERS = 'sensor_msgs/msg/Image', 'visualization_msgs/msg/MarkerArray'
ODOMETRY, DIAGNOSTICS = 'nav_msgs/msg/Odometry', 'diagnostic_msgs/msg/DiagnosticArray'
DISPLAYS = {
    'rviz_default_plugins/MarkerArray': MARKERS,
    'rviz_default_plugins/Odometry': ODOMETRY,
    'rviz_default_plugins/Image': IMAGE,
}
"""What the displays of RViz take."""
SPIKES = {f'/biped/voxel_{v}/spikes' for v in (
    '0_0', '3_0', '0_1', '1_1', '2_1', '3_1', '0_2', '1_2', '2_2', '3_2'
)}


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    """Return a bag of half a second of the bundled biped."""
    bag = tmp_path_factory.mktemp('viewers') / 'bag'
    command = ['walk', '--duration', '0.5', '--voxels-per-process', '5', '--bag', str(bag)]
    run = subprocess.run(
        [sys.executable, '-m', 'snca_ros', *command], cwd=bag.parent, text=True, timeout=LIMIT,
        env={**os.environ, 'PYTHONPATH': str(ROOT), PARENT: str(os.getpid())},
        capture_output=True, check=False,
    )
    assert run.returncode == 0, run.stderr
    return bag


@pytest.fixture(scope='module')
def walk(bag):
    """Return connections and messages of the bag by topic."""
    with Reader(bag) as reader:
        connections = {c.topic: c for c in reader.connections}
        messages = {topic: [] for topic in connections}
        for connection, _, data in reader.messages():
            messages[connection.topic].append(STORE.deserialize_cdr(data, connection.msgtype))
    return connections, messages


@pytest.fixture(scope='module')
def layout():
    return json.loads((CONFIG / 'foxglove' / 'robot.json').read_text())


@pytest.fixture(scope='module')
def rviz():
    return yaml.safe_load((CONFIG / 'rviz' / 'robot.rviz').read_text())['Visualization Manager']


def panels_of(layout, kind):
    return [v for k, v in layout['configById'].items() if k.partition('!')[0] == kind]


def leaves(tree):
    """Return the panels in the tree of splits, left before right and upper before lower."""
    if isinstance(tree, str):
        return [tree]
    assert tree['direction'] in ('row', 'column')
    assert 0 < tree['splitPercentage'] < 100
    return [*leaves(tree['first']), *leaves(tree['second'])]


def resolve(message, path):
    """Return the value at a path such as twist.linear.x or position[0]."""
    for name, index in re.findall(r'(\w+)(?:\[(\d+)\])?(?:\.|$)', path):
        message = getattr(message, name)
        message = message[int(index)] if index else message
    return message


def test_foxglove_places_every_panel_once(layout):
    assert sorted(leaves(layout['layout'])) == sorted(layout['configById'])


def test_foxglove_shows_topics_that_exist_as_what_they_are(layout, walk):
    connections, messages = walk
    (scene,) = panels_of(layout, '3D')
    shown = {topic: connections[topic].msgtype for topic in scene['topics']}
    assert shown == {'/biped/markers': MARKERS, '/biped/odometry': ODOMETRY}
    assert scene['fixedFrame'] == messages['/biped/odometry'][0].header.frame_id
    images = {panel['imageMode']['imageTopic'] for panel in panels_of(layout, 'Image')}
    assert images == SPIKES
    for topic in images:
        assert connections[topic].msgtype == IMAGE
        assert messages[topic][0].encoding == 'mono8'
    (health,) = panels_of(layout, 'DiagnosticSummary')
    assert connections[health['topicToRender']].msgtype == DIAGNOSTICS


def test_every_path_that_foxglove_plots_leads_to_a_number(layout, walk):
    _, messages = walk
    paths = [p['value'] for plot in panels_of(layout, 'Plot') for p in plot['paths']]
    assert len(paths) == 8
    for path in paths:
        topic, _, rest = path.partition('.')
        for message in (messages[topic][0], messages[topic][-1]):
            assert isinstance(float(resolve(message, rest)), float)
            assert message.header.stamp.sec == 0  # plotted over the header's time


def test_plotted_sensors_have_their_names(layout, walk):
    _, messages = walk
    names = messages['/biped/voxel_0_0/sensors'][0].name
    paths = [p for plot in panels_of(layout, 'Plot') for p in plot['paths']]
    labels = {p['value']: p['label'] for p in paths if '/sensors.' in p['value']}
    assert labels == {
        f'/biped/voxel_0_0/sensors.position[{i}]': name for i, name in enumerate(names)
    }


def test_rviz_shows_topics_that_exist_as_what_they_are(rviz, walk):
    connections, messages = walk
    topics = {display['Topic']['Value']: display for display in rviz['Displays']}
    assert set(topics) == {'/biped/markers', '/biped/odometry', *SPIKES}
    for topic, display in topics.items():
        assert connections[topic].msgtype == DISPLAYS[display['Class']]
        assert display['Topic']['Reliability Policy'] == 'Reliable'
        assert display['Topic']['Durability Policy'] == 'Transient Local'
        for qos in connections[topic].ext.offered_qos_profiles:
            assert qos.reliability == QosReliability.RELIABLE
            assert qos.durability == QosDurability.TRANSIENT_LOCAL
    markers = [m for message in messages['/biped/markers'] for m in message.markers]
    assert set(topics['/biped/markers']['Namespaces']) == {m.ns for m in markers}
    frames = {m.header.frame_id for m in [*markers, *messages['/biped/odometry']]}
    assert frames == {rviz['Global Options']['Fixed Frame']}


def test_half_a_minute_of_walking_is_in_view(layout, rviz, walk):
    """A camera of 45 degrees sees its distance to either side in a window of 2.4 : 1."""
    _, messages = walk
    (scene,) = panels_of(layout, '3D')
    camera, view = scene['cameraState'], rviz['Views']['Current']
    start = messages['/biped/odometry'][0].pose.pose.position.x
    for middle, distance in (
        (camera['targetOffset'][0], camera['distance']),
        (view['Focal Point']['X'], view['Distance']),
    ):
        assert middle - distance < start < middle < start + 140.0 < middle + distance


def test_a_film_of_the_bag_is_the_walk_that_was_recorded(bag):
    moments = np.arange(0, 30, 2) / 60
    film = film_bag(bag, moments)
    walked = film_offline(load_controller(find_controller('biped-U-nD-snn-h')), 'flat', moments)
    np.testing.assert_array_equal(film.times, walked.times)
    np.testing.assert_array_equal(film.centers, walked.centers)
    np.testing.assert_array_equal(film.corners, walked.corners)
    np.testing.assert_allclose(film.colors, walked.colors, rtol=1e-6)
    np.testing.assert_array_equal(film.terrain.x, walked.terrain.x)
    np.testing.assert_array_equal(film.terrain.y, walked.terrain.y)
