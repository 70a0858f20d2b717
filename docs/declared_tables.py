"""Parts of the documents that are made from declarations: nodes, topics, faults, options."""

import argparse
from collections.abc import Callable, Iterable, Sequence
from dataclasses import Field
from functools import partial

from sim_node.model.body_faults import FaultsOfBody
from sim_node.model.constants import declared, shown, values_of
from sim_node.ros.interface import NodeInterface, Topic
from sim_node.ros.sim_interface import SIM_NODE
from snca_ros.command_line import CommandParser
from snca_ros.commands import COMMANDS, load_command
from snca_ros.commands.declared_options import DeclaredOption
from snca_ros.faults import FAULTS_OF_CELLS, Faults
from snca_ros.nodes import interfaces

NODES = (SIM_NODE, *interfaces.NODES)


def node_section(node: NodeInterface) -> str:
    """Return the section of a node: purpose, how to run it, parameters, topics and services."""
    parameters = [
        (f'`{name}`', *_values(f), f.metadata['text'])
        for group in node.parameters for name, f in group.fields.items()
    ]
    topics = [
        (_name(topic), direction, topic.type, topic.when)
        for direction, some in (('out', node.publishes), ('in', node.subscribes)) for topic in some
    ]
    services = [(f'`{service.name}`', service.type, service.text) for service in node.serves]
    tables = [
        _table(('parameter', 'default', 'unit', 'values', 'meaning'), parameters),
        _table(('topic', 'direction', 'type', 'when'), topics),
        _table(('service', 'type', 'what it does'), services),
    ]
    parts = [f'## {node.title}: `{node.name}`', node.purpose, f'    {node.run}', *tables]
    return '\n\n'.join(part for part in parts if part) + '\n'


def topics_table() -> str:
    """Return the table of all topics: name, the nodes that publish and subscribe, content."""
    topics = dict.fromkeys(t for node in NODES for t in (*node.publishes, *node.subscribes))
    rows = [
        (
            _name(topic), ', '.join(node.name for node in NODES if topic in node.publishes),
            ', '.join(node.name for node in NODES if topic in node.subscribes), topic.content,
        )
        for topic in topics
    ]
    return _table(('topic', 'from', 'to', 'content'), rows) + '\n'


def faults_table() -> str:
    """Return the table of faults: name, nodes, default, values, meaning."""
    of_body = {f.name for f in declared(FaultsOfBody)}
    rows = []
    for f in declared(Faults):
        nodes = [SIM_NODE.name] * (f.name in of_body)
        nodes += [interfaces.VOXEL_NODE.name] * (f.name in FAULTS_OF_CELLS)
        default, _, values = _values(f)
        rows.append((f'`{f.name}`', ', '.join(nodes), default, values, f.metadata['text']))
    return _table(('name', 'node', 'default', 'values', 'meaning'), rows) + '\n'


def options_table(command: str) -> str:
    """Return the table of the options of a command that are declared constants."""
    parser = CommandParser(command, COMMANDS[command], load_command(command))
    rows = [
        (f'`{action.option_strings[0]}`', *_values(action.declared),
         action.declared.metadata['text'])
        for action in parser._actions if isinstance(action, DeclaredOption)
        and action.dest != 'workers'  # its default depends on the machine
        and action.help != argparse.SUPPRESS
    ]
    return _table(('option', 'default', 'unit', 'values', 'meaning'), rows) + '\n'


TABLES: dict[str, Callable[[], str]] = {
    'faults': faults_table, 'topics': topics_table, 'evolve': lambda: options_table('evolve'),
    'bodies': lambda: options_table('bodies'),
    **{node.name: partial(node_section, node) for node in NODES},
}
"""By the name in a document's marker, `<!-- table NAME -->`."""


def _values(f: Field) -> tuple[str, str, str]:
    """Return default, unit and possible values of a declared field."""
    return shown(f.default) if f.default != '' else '—', f.metadata['unit'], values_of(f)


def _name(topic: Topic) -> str:
    return f'`{topic.of("<voxel>") if topic.of_voxel else topic.name}`'


def _table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table in Markdown; '' without rows."""
    lines = [f'| {" | ".join(map(_escaped, row))} |' for row in rows]
    if not lines:
        return ''
    return '\n'.join([f'| {" | ".join(head)} |', '|---' * len(head) + '|', *lines])


def _escaped(cell: str) -> str:
    """Return a cell whose < and | are no markup; inside of backquotes < is none anyway."""
    parts = cell.replace('|', r'\|').split('`')
    return '`'.join(part if i % 2 else part.replace('<', '&lt;') for i, part in enumerate(parts))
