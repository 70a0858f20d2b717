"""Declarations of a node's interface: parameters, topics and services.

The nodes, the SROS 2 policy and docs/graph.md are generated from them.
"""

import textwrap
from dataclasses import Field, dataclass

from sim_node.model.constants import declared, describe, shown


@dataclass(frozen=True)
class Topic:
    """The declaration of a topic.

    Attributes:
        name: global if it begins with /; else relative to the robot's namespace, or to a voxel's
            name if `of_voxel`.
        type: message type, such as 'sensor_msgs/msg/JointState'.
        when: when messages are published.
        content: content of a message.
        of_voxel: whether each voxel has such a topic.
    """

    name: str
    type: str
    when: str
    content: str
    of_voxel: bool = False

    def of(self, voxel: str) -> str:
        """Return the topic's name for one voxel, relative to the robot's namespace."""
        return f'{voxel}/{self.name}'


@dataclass(frozen=True)
class Service:
    """The declaration of a service: name in the robot's namespace, type, and effect."""

    name: str
    type: str
    text: str


@dataclass(frozen=True)
class Parameters:
    """Parameters of a node that are declared fields of a dataclass.

    Attributes:
        kind: the dataclass.
        prefix: prefix of the field names, such as 'material.'.
        only: names of the fields that are parameters; all fields if empty.
    """

    kind: type
    prefix: str = ''
    only: tuple[str, ...] = ()

    @property
    def fields(self) -> dict[str, Field]:
        """Return the declared fields by parameter name."""
        return {
            f'{self.prefix}{f.name}': f for f in declared(self.kind)
            if not self.only or f.name in self.only
        }


@dataclass(frozen=True)
class NodeInterface:
    """The declaration of a node's interface.

    Attributes:
        name: name of the node, and of its executable if `ros2 run` starts it.
        title: heading in the documentation.
        purpose: what the node does, in one sentence.
        run: command that starts it.
        parameters, publishes, subscribes, serves: its parameters, topics and services, without
            those that every ROS node has.
    """

    name: str
    title: str
    purpose: str
    run: str
    parameters: tuple[Parameters, ...] = ()
    publishes: tuple[Topic, ...] = ()
    subscribes: tuple[Topic, ...] = ()
    serves: tuple[Service, ...] = ()


def node_help(node: NodeInterface) -> str:
    """Return the help of a node's program: what it does, how to run it, its parameters."""
    lines = [*textwrap.wrap(node.purpose, 88), '', f'usage: {node.run}', '', 'parameters:']
    for group in node.parameters:
        for name, f in group.fields.items():
            default = f' (default {shown(f.default)})' if f.default != '' else ''
            text = textwrap.wrap(describe(f) + default, 65)
            lines += [f'  {name:22} {text[0]}', *(f'{"":25}{more}' for more in text[1:])]
    return '\n'.join([*lines, '', 'docs/graph.md lists topics and services.'])


ROSOUT = Topic('/rosout', 'rcl_interfaces/msg/Log', 'when the node logs', 'what nodes log')

DIAGNOSTICS_PERIOD = 1.0
"""Wall time [s] between two diagnostic messages of a node."""

DIAGNOSTICS = Topic(
    '/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray',
    f'every {DIAGNOSTICS_PERIOD:g} s of wall time, and at once when the state changes',
    'state of the node: steps, step times, missed deadlines; of each link the messages on time, '
    'late and lost; refused messages; silent voxels',
)
