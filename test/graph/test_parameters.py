"""Node parameters: any value is taken as what was asked for, or refused by name."""

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rclpy.parameter import Parameter

from sim_node.errors import InvalidInput
from sim_node.ros import RosNode

VALUES = (
    st.booleans() | st.integers(-(2**63), 2**63 - 1) | st.floats() | st.text(max_size=30)
    | st.lists(st.integers(-(2**63), 2**63 - 1), min_size=1, max_size=3)
    | st.lists(st.floats(), min_size=1, max_size=3)
    | st.lists(st.text(max_size=9), min_size=1, max_size=3)
    | st.lists(st.booleans(), min_size=1, max_size=3)
)
DEFAULTS = {'text': ('flat',), 'number': (1.0, 0.0, 10.0), 'count': (1, 0, 10), 'flag': (False,)}


@settings(max_examples=80, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(name=st.sampled_from(sorted(DEFAULTS)), value=VALUES)
def test_any_value_is_taken_or_refused_by_name(ros, name, value):
    node = RosNode('any', parameter_overrides=[Parameter(name, value=value)])
    default, *bounds = DEFAULTS[name]
    taken, complaint = default, ''
    try:
        taken = node.parameter(name, default, 'what it is', *bounds)
    except InvalidInput as error:
        complaint = str(error)
    finally:
        node.destroy_node()
    assert not complaint or complaint.startswith(f'/any: {name}: got ')
    assert '\n' not in complaint
    assert type(taken) is type(default)
    assert not bounds or bounds[0] <= taken <= bounds[1]


@pytest.mark.parametrize('name', ['durration', 'material.', 'a' * 200])
def test_unknown_parameters_are_refused(ros, name):
    node = RosNode('any', parameter_overrides=[Parameter(name, value=1.0)])
    node.parameter('duration', 1.0, 'what it is')
    with pytest.raises(InvalidInput, match='parameter'):
        node.check_unknown_parameters()
    node.destroy_node()
