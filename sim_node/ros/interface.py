"""What a node takes and offers: its parameters, topics and services, as declarations.

The nodes, the SROS 2 policy and docs/graph.md are made from them.
"""

import textwrap
from dataclasses import Field, dataclass

from sim_node.model.constants import declared, describe, shown


@dataclass(frozen=True)
class Topic:
    """A topic.

    Attributes:
        name: with / before it global; else below the robot's namespace, or below a voxel's name.
        type: of its messages, such as 'sensor_msgs/msg/JointState'.
        when: a message is published.
        content: of a message.
        of_voxel: each voxel has one.
    """

    name: str
    type: str
    when: str
    content: str
    of_voxel: bool = False

    def of(self, voxel: str) -> str:
        """Return its name below the robot's namespace, for one voxel."""
        return f'{voxel}/{self.name}'


@dataclass(frozen=True)
class Service:
    """A service: its name below the robot's namespace, its type, and what it does."""

    name: str
    type: str
    text: str


@dataclass(frozen=True)
class Parameters:
    """Parameters of a node: the declared fields of a dataclass.

    Attributes:
        kind: the dataclass.
        prefix: before the name of a field, such as 'material.'.
        only: names of the fields that are parameters; all if empty.
    """

    kind: type
    prefix: str = ''
    only: tuple[str, ...] = ()

    @property
    def fields(self) -> dict[str, Field]:
        """Return the fields by the name of the parameter."""
        return {
            f'{self.prefix}{f.name}': f for f in declared(self.kind)
            if not self.only or f.name in self.only
        }


@dataclass(frozen=True)
class NodeInterface:
    """A kind of node.

    Attributes:
        name: of the node; of its program, too, if `ros2 run` starts it.
        title: for people.
        purpose: one sentence.
        run: how to start one.
        parameters, publishes, subscribes, serves: besides those that every ROS node has.
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
            text = textwrap.wrap(describe(f) + default, 66)
            lines += [f'  {name:22}{text[0]}', *(f'{"":24}{more}' for more in text[1:])]
    return '\n'.join([*lines, '', 'docs/graph.md lists topics and services.'])


ROSOUT = Topic('/rosout', 'rcl_interfaces/msg/Log', 'when the node logs', 'what nodes log')

DIAGNOSTICS_PERIOD = 1.0
"""Seconds of wall time between two messages of a node about its state."""

DIAGNOSTICS = Topic(
    '/diagnostics', 'diagnostic_msgs/msg/DiagnosticArray',
    f'every {DIAGNOSTICS_PERIOD:g} s of wall time, and at once when the state changes',
    'state of the node: steps, step times, missed deadlines; of each link the messages on time, '
    'late and lost; refused messages; silent voxels',
)
