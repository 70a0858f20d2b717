"""Bags say in which body the robot walked, and controllers are put into it."""

import json

import numpy as np
import pytest
from support.controller_files import make
from support.synthetic_bag import (
    Walk,
    make_walk,
    messages_of_walk,
    odometry,
    write_messages,
)

from sim_node.errors import InvalidInput
from snca_ros.cli import main
from snca_ros.controller_file import save_controller
from snca_ros.recording.bag import read_bag
from snca_ros.recording.body import in_body_of
from snca_ros.recording.energy import count_operations
from snca_ros.recording.offline import record_offline, replayed_thresholds

SECONDS = 0.5


def written(trained, path, body=None):
    """Return the bag of an offline walk, as a recorder would have written it."""
    recording, thresholds = record_offline(trained, path, SECONDS)
    n = recording.n_steps - 1
    walk = Walk(
        recording.voxel_names, recording.centers, recording.readings[:n], recording.actuation[:n],
        recording.spikes[:n], corners=recording.poses.corners, ground=recording.poses.ground,
        body=trained.morphology.grid_string if body is None else body,
    )
    return write_messages(path / 'bag', messages_of_walk(walk)), thresholds


@pytest.mark.parametrize(('name', 'change'), [
    ('U-nD', lambda one: one.in_body('tripod')),
    ('U-nD', lambda one: one.in_body('111').without('voxel_0_0')),
    ('nU-D', lambda one: one.without('voxel_1_1')),
])
def test_a_bag_is_read_with_the_controller_from_which_its_body_was_made(
    name, change, tmp_path, capsys
):
    own = make(name, 'snn-h', '11-10')
    trained = change(own)
    bag, expected = written(trained, tmp_path)
    recording = read_bag(bag)
    assert recording.body.grid_string == trained.morphology.grid_string
    assert recording.voxel_names == trained.morphology.voxel_names
    for given in (own, trained):
        np.testing.assert_array_equal(replayed_thresholds(recording, given)[:-1], expected[:-1])
    save_controller(tmp_path / 'own.npz', own)
    numbers = tmp_path / 'report.json'
    command = ['report', str(bag), '--json', str(numbers), '--controller',
               str(tmp_path / 'own.npz'), '--html']
    assert main(command) == 0
    out = capsys.readouterr().out
    assert f'body       {recording.body.label}\n' in out
    assert f'{tmp_path / "own.npz"}, evolved as 11-10 on flat, in the body of the bag\n' in out
    report = json.loads(numbers.read_text())
    assert report['body'] == trained.morphology.grid_string
    assert report['missing'] == list(trained.morphology.missing_names)
    operations = count_operations(trained, recording.readings, recording.spikes)
    assert report['operations']['additions'] == operations.additions
    assert f'({recording.body.label}), physics' in (bag / 'replay.html').read_text()
    assert main(['replay', str(bag), '--controller', str(tmp_path / 'own.npz')]) == 0


@pytest.mark.parametrize('body', ['', 'biped', '111', 'bipd', '\u0663', '11-11'])
def test_an_unknown_body_is_none(tmp_path, body, capsys):
    trained = make('U-nD', 'snn-h', '11')
    bag, _ = written(trained, tmp_path, body)
    recording = read_bag(bag)
    assert recording.body is None
    assert in_body_of(recording, trained) is trained
    with pytest.raises(InvalidInput, match=r'got .*3 voxels.*expected the 2 of the bag'):
        in_body_of(recording, make('U-nD', 'snn-h', '111'))
    assert main(['report', str(bag), '--json', '-']) == 0
    out, err = capsys.readouterr()
    assert (json.loads(out)['body'], json.loads(out)['missing']) == (None, [])
    assert 'body  ' not in err


def test_a_foreign_message_does_not_hide_the_body(tmp_path):
    walk = make_walk(6, body='111-1x1', voxels=('voxel_0_0', 'voxel_2_0', *(
        f'voxel_{x}_1' for x in range(3)
    )))
    messages = messages_of_walk(walk)
    messages[0].insert(0, ('/biped/odometry', odometry(0, np.zeros(2), 'nonsense')))
    messages[0].insert(0, ('/biped/odometry', (b'\0\1\0\0', 'nav_msgs/msg/Odometry')))
    bag = write_messages(tmp_path / 'bag', messages)
    assert read_bag(bag).body.missing_names == ('voxel_1_0',)


def test_a_controller_that_does_not_fit_is_refused(tmp_path):
    bag, _ = written(make('U-nD', 'snn-h', '111'), tmp_path)
    with pytest.raises(InvalidInput, match=r'11-10, 3 voxels.*expected the 3 of the bag'):
        in_body_of(read_bag(bag), make('nU-D', 'mlp', '11-10'))
