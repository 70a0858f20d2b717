"""A robot whose sensors come from a plug-in walks over ROS as it does offline, to the bit."""

import os
import subprocess
import sys

import numpy as np
from support.limits import LIMIT
from support.paths import ROOT
from support.tilt_sensor import Turned

from sim_node.model.sensors import DEFAULT_SENSORS, SENSORS
from sim_node.registry import PLUGINS
from snca_ros.controller_file import load_controller
from snca_ros.graph.child_process import PARENT
from snca_ros.recording.bag import read_bag
from snca_ros.recording.offline import record_offline

FIVE = ('tilt', *DEFAULT_SENSORS)


def test_a_graph_with_a_sensor_of_a_plug_in_repeats_the_offline_walk(
    make_controller, tmp_path, monkeypatch
):
    environment = {
        **os.environ, PARENT: str(os.getpid()), PLUGINS: 'support.tilt_plugin',
        'PYTHONPATH': os.pathsep.join([str(ROOT), str(ROOT / 'test')]),
    }
    monkeypatch.setitem(SENSORS._entries, 'tilt', Turned())
    path, bag = make_controller('11-10', 'U-D', 'snn-h', sensors=FIVE), tmp_path / 'bag'
    twin, _ = record_offline(load_controller(path), path, 1.0)
    walked = subprocess.run(
        [sys.executable, '-m', 'snca_ros', 'walk', path, '--duration', '1',
         '--voxels-per-process', '2', '--bag', bag],
        env=environment, cwd=tmp_path, text=True, timeout=LIMIT, capture_output=True, check=False,
    )
    assert walked.returncode == 0, walked.stderr
    recording = read_bag(bag)
    assert recording.sensors == twin.sensors == FIVE
    np.testing.assert_array_equal(recording.centers, twin.centers)
    np.testing.assert_array_equal(recording.readings[:60], twin.readings[:60])
    np.testing.assert_array_equal(recording.actuation[:60], twin.actuation[:60])
    assert len(np.unique(recording.readings[:60, :, 0])) > 100
    assert 'bit for bit the same' in walked.stdout + walked.stderr
