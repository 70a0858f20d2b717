"""(ROS) Declaration of a node's parameters from the declared fields of dataclasses."""

from dataclasses import replace
from typing import Any, TypeVar

from sim_node.errors import InvalidInput, near_miss
from sim_node.model.constants import describe
from sim_node.ros.interface import Parameters
from sim_node.ros.node_base import RosNode

_OF_ROS = ('use_sim_time', 'start_type_description_service')

_Options = TypeVar('_Options')


def declare(node: RosNode, parameters: Parameters, defaults: _Options) -> _Options:
    """Declare parameters of a node; return their values as an instance of their dataclass.

    Args:
        node: the node.
        parameters: the parameters to declare.
        defaults: instance of their dataclass with the default values.

    Returns:
        A copy of `defaults` with the values that were given to the node.

    Raises:
        InvalidInput: a value has the wrong type or is out of range; the error names the node.
    """
    values = {}
    for name, f in parameters.fields.items():
        default, meta = getattr(defaults, f.name), f.metadata
        if 'low' in meta:
            if isinstance(f.default, float):  # a file may contain 1 for 1.0
                default = float(default)
            values[f.name] = node.parameter(name, default, describe(f), meta['low'], meta['high'])
        else:
            mixed = len({type(known) for known in meta.get('choices', ())}) > 1
            values[f.name] = node.parameter(name, default, describe(f), any_type=mixed)
    changed: Any = defaults
    try:
        return replace(changed, **values)
    except InvalidInput as error:
        raise error.found_in(node.where()) from None


def check_unknown_parameters(node: RosNode) -> None:
    """Raise InvalidInput if a value was given for a parameter that the node has not declared."""
    for name, override in node._parameter_overrides.items():
        if name in _OF_ROS or node.has_parameter(name):
            continue
        names = sorted(set(node._parameters) - set(_OF_ROS))
        expected = f'one of {", ".join(names)}' + near_miss(name, names)
        if name.startswith('qos_overrides.'):
            fixed = 'the QoS of topics is fixed by `reliability`, see docs/graph.md'
            expected = f'no such parameter: {fixed}'
        raise InvalidInput(f'parameter {name}', override.value, expected, node.where())
