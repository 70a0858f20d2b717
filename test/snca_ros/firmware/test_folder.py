"""`snca firmware`: the folder, what is refused, and that nothing half-written is left."""

import os
import re
import subprocess
from dataclasses import replace

import numpy as np
import pytest
from support.firmware import needs_gcc, untrained, write
from support.plugin_neurons import Pacemaker

from sim_node.errors import InvalidInput
from snca_ros import cli
from snca_ros.cell.models import NEURON_MODELS
from snca_ros.controller_file import save_controller
from snca_ros.firmware.boards import BOARDS
from snca_ros.firmware.folder import SOURCE

NEURON_MODELS.pop('pacemaker', None)  # the tests of plug-ins register them, one by one
NEURON_MODELS.pop('integrator', None)


def call(capsys, *arguments):
    code = cli.main(['firmware', *map(str, arguments)])
    out, err = capsys.readouterr()
    assert out == ''
    return code, err


def refused(capsys, *arguments):
    code, err = call(capsys, *arguments)
    assert code == 2
    assert err.count('\n') == 1
    return err


@needs_gcc
def test_command_writes_a_folder_that_make_builds(tmp_path, capsys):
    out = tmp_path / 'firmware'
    code, err = call(capsys, 'biped-U-nD-snn-h', '--out', out, '--arithmetic', 'int8')
    assert code == 0
    assert f'make -C {out}' in err
    subprocess.run(['make', '-C', out], check=True, capture_output=True)
    assert [path.name for path in (out / 'build/posix').iterdir()] == ['cell.elf']
    other = subprocess.run(['make', '-C', out, 'BOARD=arduino'], check=False, capture_output=True)
    assert other.returncode != 0
    assert b'no board arduino' in other.stderr


def test_an_empty_folder_is_filled_and_another_is_left_alone(tmp_path, capsys):
    out = tmp_path / 'firmware'
    out.mkdir()
    assert call(capsys, 'worm-U-D-mlp', '--out', out)[0] == 0
    before = {path: path.stat().st_mtime_ns for path in out.rglob('*')}
    assert 'out: got' in refused(capsys, 'worm-U-D-mlp', '--out', out)
    assert {path: path.stat().st_mtime_ns for path in out.rglob('*')} == before
    assert [*tmp_path.iterdir()] == [out]


def test_nothing_is_left_of_a_folder_that_cannot_be_written(tmp_path, capsys, monkeypatch):
    def fail(*names):
        raise OSError(28, os.strerror(28))

    monkeypatch.setattr('snca_ros.firmware.folder.os.rename', fail)
    assert 'No space left' in refused(capsys, 'worm-U-D-mlp', '--out', tmp_path / 'firmware')
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize('arithmetic', ['int16', 'int8'])
def test_integers_are_refused_where_they_are_no_good(arithmetic, tmp_path, capsys):
    text = refused(capsys, 'worm-U-D-mlp', '--out', tmp_path / 'a', '--arithmetic', arithmetic)
    assert f"arithmetic: got '{arithmetic}', expected double or float32: a perceptron in" in text
    printed = untrained('U-nD', 'snn-h', as_printed=True)
    with pytest.raises(InvalidInput, match='the leak of the printed equations, 1e-05 per step'):
        printed.in_arithmetic(arithmetic)


def test_unknown_neuron_model_is_refused_by_name(tmp_path, capsys):
    NEURON_MODELS['pacemaker'] = Pacemaker()
    try:
        trained = untrained('U-nD', 'pacemaker')
        save_controller(tmp_path / 'one.npz', trained)
        text = refused(capsys, tmp_path / 'one.npz', '--out', tmp_path / 'firmware')
        assert "neuron_model: got 'pacemaker', expected mlp, snn or snn-h" in text
        with pytest.raises(InvalidInput, match='double: Pacemaker has no equations in another'):
            trained.in_arithmetic('float32')
    finally:
        del NEURON_MODELS['pacemaker']
    assert not (tmp_path / 'firmware').exists()


def test_weights_beyond_32_bits_are_refused(tmp_path):
    trained = untrained('U-nD', 'snn-h', arithmetic='int8')
    trained.parameters[0] = 9000.0
    with pytest.raises(InvalidInput, match='sum of the weights of a neuron: got'):
        write(trained, tmp_path / 'firmware')


def test_label_of_any_name_is_a_string_of_c(tmp_path, capsys):
    path = tmp_path / 'a"b\\ü* ??.npz'
    save_controller(path, untrained('U-D', 'mlp'))
    assert call(capsys, path, '--out', tmp_path / 'firmware')[0] == 0
    text = (tmp_path / 'firmware/images/cell/params.h').read_text()
    assert '#define LABEL "a_b__* __"' in text


def test_numbers_in_the_c_are_exact(tmp_path):
    trained = untrained('U-nD', 'mlp')
    text = (write(trained, tmp_path / 'firmware') / 'images/cell/weights.c').read_text()
    found = [float.fromhex(number) for number in re.findall(r'-?0x[0-9a-f.]+p[+-]\d+', text)]
    assert set(trained.parameters) <= set(found)
    assert np.isfinite(found).all()


def test_c_is_short_enough_to_be_read():
    def lines(path):
        return len(path.read_text().splitlines())

    assert sum(lines(SOURCE / name) for name in ('cell.h', 'cell.c', 'link.h', 'link.c')) <= 400
    boards = [*(SOURCE / 'boards').iterdir()]
    assert {path.stem for path in boards} >= {'posix', 'microbit', 'mps2'}
    assert max(map(lines, boards)) <= 120
    assert all(len(line) <= 100 for path in (*SOURCE.glob('*.[ch]'), *boards)
               for line in path.read_text().splitlines())


def test_every_board_has_a_rule():
    text = (SOURCE / 'Makefile').read_text()
    assert set(re.findall(r'^COMPILER_(\w+) =', text, re.MULTILINE)) == set(BOARDS)


def test_other_arithmetic_is_kept_in_controller_files_and_left_out_if_usual(tmp_path):
    plain = untrained('U-nD', 'snn-h')
    assert 'arithmetic' not in plain.architecture.to_dict()
    fixed = plain.in_arithmetic('int16').architecture
    assert type(fixed).from_dict(fixed.to_dict()) == fixed
    assert replace(fixed, arithmetic='double') == plain.architecture
