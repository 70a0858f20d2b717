"""(ROS) Declares the parameters of a node from the declared fields of dataclasses."""

from dataclasses import replace
from typing import Any, TypeVar

from sim_node.errors import InvalidInput
from sim_node.model.constants import describe
from sim_node.ros.interface import Parameters
from sim_node.ros.node_base import RosNode

_Options = TypeVar('_Options')


def declare(node: RosNode, parameters: Parameters, defaults: _Options) -> _Options:
    """Declare parameters of a node; return their values.

    Args:
        node: to declare them.
        parameters: which.
        defaults: instance of their dataclass with the values of the parameters that are not given.

    Returns:
        The instance with the values that are given.

    Raises:
        InvalidInput: a value is off; the error names the node.
    """
    values = {}
    for name, f in parameters.fields.items():
        default, meta = getattr(defaults, f.name), f.metadata
        if 'low' in meta:
            if isinstance(f.default, float):  # a file may have 1 where 1.0 is meant
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
