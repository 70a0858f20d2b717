"""Controller files, good and wrong ones, and what is said against these."""

import json
import math
from dataclasses import fields
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings
from hypothesis import strategies as st

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from snca_ros.cell.architecture import Architecture
from snca_ros.controller_file import load_controller
from snca_ros.trained_controller import TrainedController

quick = settings(max_examples=100)
json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=5,
)


def make(name='U-D', model='mlp', shape='11', seed=0, **options) -> TrainedController:
    architecture, morphology = Architecture.named(name, model), parse_morphology(shape)
    n = architecture.n_parameters(morphology.n_voxels)
    theta = np.random.default_rng(seed).uniform(-1, 1, n)
    return TrainedController(architecture, morphology, theta, **options)


def write(path, header, theta=None, **entries) -> None:
    """Write a file with `header` (as JSON unless an array) and `theta`; None leaves one out."""
    if header is not None:
        is_array = isinstance(header, np.ndarray)
        entries['header'] = header if is_array else np.array(json.dumps(header))
    np.savez(path, **entries, **({} if theta is None else {'theta': theta}))


def refusal(path: Path) -> str:
    """Return what `load_controller` says against the file: one line that begins with its name."""
    with pytest.raises(InvalidInput) as caught:
        load_controller(path)
    text = str(caught.value)
    assert text.startswith(f'{path}: ')
    assert '\n' not in text
    assert ': got ' in text
    assert ', expected ' in text
    return text.removeprefix(f'{path}: ')


THETA = make().parameters


def assert_same(one: TrainedController, two: TrainedController) -> None:
    for f in fields(TrainedController):
        a, b = getattr(one, f.name), getattr(two, f.name)
        if f.name == 'parameters':
            assert a.dtype == b.dtype == np.float64
            assert a.tobytes() == b.tobytes()
        elif f.name == 'fitness' and math.isnan(a):
            assert math.isnan(b)
        elif f.name != 'versions' or a:  # the saver fills in versions that are not given
            assert a == b, f.name
