"""What most tests of controller files begin with: a path, and the header of a good file."""

import json
from pathlib import Path

import numpy as np
import pytest
from support.controller_files import make

from snca_ros.controller_file import save_controller


@pytest.fixture(scope='module')
def header(tmp_path_factory) -> dict:
    """Return the header of a good file."""
    path = tmp_path_factory.mktemp('good') / 'good.npz'
    save_controller(path, make())
    with np.load(path, allow_pickle=False) as data:
        assert set(data.files) == {'header', 'theta'}
        return json.loads(data['header'].item())


@pytest.fixture
def path(tmp_path) -> Path:
    return tmp_path / 'controller.npz'
