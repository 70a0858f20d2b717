"""Results as JSON: on standard output nothing else, without numbers that JSON does not have."""

import json

import numpy as np
import pytest
from support.paths import ROOT

from sim_node.errors import InvalidInput
from snca_ros.cli import main
from snca_ros.commands.json_output import json_output, json_text

EXAMPLE = ROOT / 'results' / 'example'


def test_numbers_of_numpy_and_infinities():
    results = {'v': np.float64(0.5), 'n': [np.int64(3), -np.inf, (np.nan,)], 'a': np.ones(2)}
    assert json.loads(json_text(results)) == {'v': 0.5, 'n': [3, None, [None]], 'a': [1.0, 1.0]}


def test_standard_output_has_only_json(capsys):
    with json_output('-') as write:
        print('text')
        write({'a': 1})
    out, err = capsys.readouterr()
    assert (json.loads(out), err) == ({'a': 1}, 'text\n')


def test_a_file_that_cannot_be_written_is_refused_before_anything_is_computed(tmp_path, capsys):
    assert main(['study', str(EXAMPLE), '--text', '--json', str(tmp_path / 'no' / 'a.json')]) == 2
    out, err = capsys.readouterr()
    assert out == ''
    assert err.startswith(f"snca study: error: {tmp_path / 'no' / 'a.json'}: json: got ")
    with pytest.raises(InvalidInput, match='json'), json_output(str(tmp_path)):
        pass


def test_study_and_history_of_a_campaign(tmp_path, capsys):
    file = tmp_path / 'study.json'
    assert main(['study', str(EXAMPLE), '--text', '--json', str(file)]) == 0
    found = json.loads(file.read_text())
    assert {row['shape'] for row in found['comparisons']} == {'worm'}
    assert found['missing'] == []
    capsys.readouterr()
    assert main(['history', str(EXAMPLE), '--json', '-']) == 0
    out, err = capsys.readouterr()
    histories = json.loads(out)
    assert len(histories) == len(list((EXAMPLE / 'histories').iterdir())) == 6
    for history in histories:
        assert (history['quantity'], history['episodes'], history['finished']) == (
            'v_x', 500, True
        )
        best = history['history']['best_so_far']
        assert best == sorted(best)
        assert f'{history["run"]}: 500 episodes, best {best[-1]:.3f} m/s\n' in err
    assert 'generation' not in err
