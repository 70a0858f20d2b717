"""(ROS) The SROS 2 policy of a robot: the topics and services that each node may use."""

import xml.etree.ElementTree as ET
from dataclasses import dataclass

from sim_node.ros.interface import DIAGNOSTICS, ROSOUT
from sim_node.ros.sim_interface import ACTUATION, CLOCK, OWN_CLOCK, PRESENCE, SENSORS, SIM_NODE
from snca_ros.graph.description import Graph
from snca_ros.nodes.interfaces import RECORDER_NODE

_POLICY_VERSION = '0.2.0'
_SIMULATION_TOPICS = OWN_CLOCK, *(
    topic.name for topic in SIM_NODE.publishes
    if not topic.of_voxel and topic not in (PRESENCE, DIAGNOSTICS, ROSOUT)
)
_PUBLISHED_BY_ALL = (DIAGNOSTICS.name, '/parameter_events', ROSOUT.name)
_SERVED_BY_ALL = tuple(f'~/{name}' for name in (
    'describe_parameters', 'get_parameter_types', 'get_parameters', 'get_type_description',
    'list_parameters', 'set_parameters', 'set_parameters_atomically',
))


@dataclass(frozen=True)
class Access:
    """The topics and services that a node may use, besides those that every node uses.

    Names are relative to the robot's namespace, unless they begin with / or ~.

    Attributes:
        publish: topics that it may publish.
        subscribe: topics to which it may subscribe.
        reply: services that it may serve.
    """

    publish: tuple[str, ...] = ()
    subscribe: tuple[str, ...] = ()
    reply: tuple[str, ...] = ()


def access_of_nodes(graph: Graph, messages: str) -> dict[str, Access]:
    """Return the access of each node of a robot, by the node's name.

    Args:
        graph: the whole robot, with simulation and recorder.
        messages: topic of the cells' messages, `spikes` or `values`.
    """
    voxels = {n: values for process in graph.voxels for n, values in process.parameters.items()}
    sensors = tuple(SENSORS.of(voxel) for voxel in voxels)
    actuation = tuple(ACTUATION.of(voxel) for voxel in voxels)
    cell_messages = tuple(f'{voxel}/{messages}' for voxel in voxels)
    access = {
        SIM_NODE.name: Access(
            (*_SIMULATION_TOPICS, PRESENCE.name, *sensors),
            (*actuation, CLOCK.name, PRESENCE.name),
            tuple(service.name for service in SIM_NODE.serves),
        ),
        RECORDER_NODE.name: Access((), (
            *_SIMULATION_TOPICS, *sensors, *actuation, *cell_messages, DIAGNOSTICS.name,
            ROSOUT.name,
        )),
        'walk': Access((), (DIAGNOSTICS.name, PRESENCE.name)),
        'voxels': Access(),
    }
    for voxel, values in voxels.items():
        neighbors = [name for key, name in values.items() if key.startswith('neighbor.')]
        of_neighbors = tuple(f'{neighbor}/{messages}' for neighbor in neighbors)
        access[voxel] = Access(
            (ACTUATION.of(voxel), f'{voxel}/{messages}'),
            (SENSORS.of(voxel), ACTUATION.of(voxel), PRESENCE.name, *of_neighbors),
        )
    return access


def policy_xml(graph: Graph, messages: str) -> str:
    """Return the SROS 2 policy of a robot as XML, with an enclave for each process.

    Args:
        graph: the whole robot, with simulation and recorder.
        messages: topic of the cells' messages, `spikes` or `values`.
    """
    access = access_of_nodes(graph, messages)
    enclaves = {graph.enclave(p.name): tuple(p.parameters) for p in graph.processes}
    enclaves.update({graph.enclave(name): (name,) for name in ('walk', 'voxels')})
    policy = ET.Element('policy', version=_POLICY_VERSION)
    root = ET.SubElement(policy, 'enclaves')
    for path, nodes in enclaves.items():
        profiles = ET.SubElement(ET.SubElement(root, 'enclave', path=path), 'profiles')
        for node in nodes:
            profile = ET.SubElement(profiles, 'profile', ns=f'/{graph.robot}', node=node)
            mine = access[node]
            _allow(profile, 'topic', 'publish', (*_PUBLISHED_BY_ALL, *mine.publish))
            _allow(profile, 'topic', 'subscribe', mine.subscribe)
            _allow(profile, 'service', 'reply', (*_SERVED_BY_ALL, *mine.reply))
    ET.indent(policy)
    return ET.tostring(policy, encoding='unicode', xml_declaration=True)


def _allow(profile: ET.Element, kind: str, verb: str, names: tuple[str, ...]) -> None:
    if names:
        group = ET.SubElement(profile, f'{kind}s', {verb: 'ALLOW'})
        for name in names:
            ET.SubElement(group, kind).text = name
