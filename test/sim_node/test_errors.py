"""Errors show values in short, and numbers of numpy as numbers."""

import numpy as np
import pytest

from sim_node.errors import InvalidInput


@pytest.mark.parametrize(('value', 'shown'), [
    (np.float64(900.0), '900.0'), (np.int32(3), '3'),
    ([np.float32(0.5), (np.True_,)], '[0.5, (True,)]'),
    (np.arange(3), '[0, 1, 2]'), ({'a': np.int64(1)}, "{'a': 1}"), (np.str_('x'), "'x'"),
    ('np.float64(1.0)', "'np.float64(1.0)'"), (None, 'None'),
])
def test_values_of_numpy_are_shown_as_numbers(value, shown):
    assert str(InvalidInput('x', value, 'y')) == f'x: got {shown}, expected y'
