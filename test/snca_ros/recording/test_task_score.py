"""Reports score a walk by the task of its controller, also if that needs more than a bag holds."""

import json
from dataclasses import replace

import numpy as np
import pytest
from support.synthetic_bag import Walk, messages_of_walk, write_messages

import snca_ros as snca
from snca_ros.assessment.trials import Trial, score
from snca_ros.cli import main
from snca_ros.controller_file import save_controller
from snca_ros.faults import parse_faults
from snca_ros.recording.offline import record_offline
from snca_ros.recording.task_score import score_walk

SECONDS = 7.0
FAULTS = parse_faults('broken_actuators=frozen:0.1@2,loss=0.2,seed=5')


@pytest.fixture(scope='module')
def trained():
    return snca.load('biped-U-D-mlp').trained


@pytest.mark.parametrize('task', ['walk', 'jump', 'climb', 'economy'])
def test_the_score_of_a_recorded_walk_is_that_of_its_episode(trained, task, tmp_path):
    own = replace(trained, task=task)
    for terrain, faults in (('flat', FAULTS), ('stairs-0.05-10', None)):
        recording, _ = record_offline(own, tmp_path, SECONDS, terrain, faults)
        trial = Trial(own, terrain, duration=SECONDS)
        expected = score(trial if faults is None else replace(trial, faults=faults)).score
        assert score_walk(recording, own).score == expected != 0.0


def test_it_is_not_known_of_a_walk_that_cannot_be_repeated(trained, tmp_path):
    recording, _ = record_offline(trained, tmp_path, SECONDS)
    gap = recording.centers.copy()
    gap[100] = np.nan
    applied = recording.applied.copy()
    applied[200] *= 0.5
    jump = replace(trained, task='jump')
    for change in ({'applied': applied}, {'poses': None}, {'centers': gap}):
        found = score_walk(replace(recording, **change), jump)
        assert found.score is None
        assert found.line.startswith('task       jump: rise [m] is not known')
    changed = replace(recording, applied=applied)
    assert score_walk(changed, replace(trained, task='climb')).score > 1.0  # centres are enough


def test_report_names_quantity_and_unit(trained, tmp_path, capsys):
    climber = replace(trained, task='climb')
    save_controller(tmp_path / 'climber.npz', climber)
    walked = snca.load(tmp_path / 'climber.npz').run(6.0, ('readings', 'actuation', 'values'))
    bag = tmp_path / 'bag'
    write_messages(bag, messages_of_walk(Walk(
        walked.voxel_names, walked.centers, walked.readings[:-1], walked.actuation,
        values=walked.values,
    )))
    out = tmp_path / 'report.json'
    options = '--controller', str(tmp_path / 'climber.npz'), '--json', str(out)
    assert main(['report', str(bag), *options]) == 0
    distance = walked.centers[-1, 0] - walked.centers[0, 0]
    assert f'task       climb: distance {distance:.3f} m\n' in capsys.readouterr().out
    assert json.loads(out.read_text())['task'] == {
        'task': 'climb', 'quantity': 'distance', 'unit': 'm', 'score': pytest.approx(distance),
    }
