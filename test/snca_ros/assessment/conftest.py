"""Controllers for the tests of assessments."""

import pytest
from support.assessment import trained_worm

from snca_ros.controller_file import save_controller


@pytest.fixture
def worms(tmp_path):
    """Two controller files of a small worm."""
    for seed in range(2):
        save_controller(tmp_path / f'{seed}.npz', trained_worm(seed))
    return [str(tmp_path / f'{seed}.npz') for seed in range(2)]
