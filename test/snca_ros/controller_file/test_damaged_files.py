"""Files that are no controller files, or not whole, are refused; nothing in them is run.

They are written with plain numpy, so that these tests do not depend on `save_controller` alone.
"""

import io
import json
import os
import pickle
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from support.controller_files import THETA, assert_same, make, quick, refusal, write

from sim_node.errors import InvalidInput
from sim_node.model.body_file import MOST_PARAMETERS
from sim_node.model.morphology import parse_morphology
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import load_controller, save_controller
from snca_ros.trained_controller import TrainedController


def test_truncated_anywhere(path):
    save_controller(path, make())
    whole = path.read_bytes()
    lengths = [*range(0, len(whole), 5), *range(len(whole) - 64, len(whole))]
    for length in lengths:
        path.write_bytes(whole[:length])
        assert refusal(path).startswith('file: got ')


def test_any_flipped_byte_is_noticed_or_harmless(path):
    trained = make()
    save_controller(path, trained)
    whole = path.read_bytes()
    noticed = 0
    for i in range(len(whole)):
        mask = (0x01, 0x80, 0xFF)[i % 3]
        path.write_bytes(whole[:i] + bytes([whole[i] ^ mask]) + whole[i + 1 :])
        try:
            loaded = load_controller(path)
        except InvalidInput:
            noticed += 1
        else:  # dates, permissions and the like inside the archive
            assert_same(trained, loaded)
    assert noticed > len(whole) * 3 // 4


@pytest.mark.parametrize(
    'begin', [b'', b'PK\x03\x04', b'PK\x05\x06', b'\x93NUMPY\x01\x00', b'\x80\x04']
)
def test_random_bytes(path, begin):
    rng = np.random.default_rng(len(begin))
    for size in (0, 1, 2, 3, 5, 10, 22, 100, 1000, 100_000):
        path.write_bytes(begin + rng.bytes(size))
        assert refusal(path).startswith('file: got ')


@quick
@given(content=st.binary(max_size=300))
def test_any_bytes(tmp_path_factory, content):
    path = tmp_path_factory.mktemp('any') / 'any.npz'
    path.write_bytes(content)
    refusal(path)


@pytest.mark.parametrize(
    'content', [b'', b'hello\n', b'{"theta": []}', b'\x1f\x8b\x08', bytes(512)]
)
def test_other_kinds_of_files(path, content):
    path.write_bytes(content)
    assert 'a controller file (.npz)' in refusal(path)


def test_missing_file(path):
    assert refusal(path).startswith("file: got 'No such file or directory'")


def test_directory(tmp_path):
    assert refusal(tmp_path).startswith("file: got 'Is a directory'")


def test_path_through_a_file(path):
    path.write_bytes(b'')
    assert refusal(path / 'x.npz').startswith("file: got 'Not a directory'")


@pytest.mark.skipif(os.geteuid() == 0, reason='root may read everything')
def test_unreadable_file(path):
    save_controller(path, make())
    path.chmod(0)
    assert refusal(path).startswith("file: got 'Permission denied'")


def test_oversized_file(path):
    save_controller(path, make())
    with path.open('r+b') as file:
        file.truncate(65 * 2**20 + 1)
    assert refusal(path) == f"file: got '{65 * 2**20 + 1} bytes', expected at most {65 * 2**20}"


def test_largest_file_can_be_read(path):
    cells = Architecture.named('nU-nD', 'mlp', hidden=(1024, 1024))
    theta = np.zeros(cells.n_parameters(7))
    assert 0.89 * MOST_PARAMETERS < len(theta) < MOST_PARAMETERS
    trained = TrainedController(cells, parse_morphology('worm-7x1'), theta)
    save_controller(path, trained)
    assert load_controller(path).parameters.shape == theta.shape
    larger = replace(trained, parameters=np.zeros(MOST_PARAMETERS + 1))
    with pytest.raises(InvalidInput, match=f'parameters: got {MOST_PARAMETERS + 1}, expected'):
        save_controller(path.with_name('larger.npz'), larger)
    assert not path.with_name('larger.npz').exists()


def test_small_file_of_large_content(path, header):
    # 66 MB of zeros, compressed to less than 0.1 MB.
    zeros = np.zeros(66 * 2**20, dtype=np.uint8)
    np.savez_compressed(path, header=np.array(json.dumps(header)), theta=zeros)
    assert path.stat().st_size < 2**17
    assert 'at most' in refusal(path)


def test_claimed_size_is_not_believed(path, header):
    text, claim = io.BytesIO(), io.BytesIO()
    np.save(text, np.array(json.dumps(header)))
    shape = {'descr': '<f8', 'fortran_order': False, 'shape': (10**13,)}
    np.lib.format.write_array_header_1_0(claim, shape)
    with zipfile.ZipFile(path, 'w') as archive:
        archive.writestr('header.npy', text.getvalue())
        archive.writestr('theta.npy', claim.getvalue() + bytes(117 * 8))
    refusal(path)


def test_single_array(path):
    with path.open('wb') as file:
        np.save(file, THETA)
    assert refusal(path).startswith("file: got 'a single array'")


class Trap:
    """Leaves a file behind when it is unpickled."""

    def __init__(self, mark: Path) -> None:
        self.mark = mark

    def __reduce__(self):
        return Path.touch, (self.mark,)


def test_pickle_is_refused_and_not_run(path, tmp_path):
    path.write_bytes(pickle.dumps(Trap(tmp_path / 'mark')))
    assert 'pickle' in refusal(path)
    assert not (tmp_path / 'mark').exists()


@pytest.mark.parametrize('entry', ['header', 'theta'])
def test_pickled_array_is_refused_and_not_run(path, tmp_path, header, entry):
    trap = np.array([Trap(tmp_path / 'mark')] * (1 if entry == 'header' else 117), dtype=object)
    entries = {'header': header, 'theta': THETA, entry: trap}
    write(path, **entries)
    assert 'allow_pickle=False' in refusal(path)
    assert not (tmp_path / 'mark').exists()
