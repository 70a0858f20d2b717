"""Topics, services and parameters of nodes are those declared, which docs/graph.md lists."""

import pytest
from rcl_interfaces.srv import DescribeParameters, ListParameters
from rosbags.rosbag2 import StoragePlugin

from sim_node.model.constants import describe
from sim_node.ros.interface import DIAGNOSTICS, ROSOUT
from sim_node.ros.sim_interface import CLOCK, PRESENCE, SIM_NODE
from snca_ros.controller_file import load_controller
from snca_ros.graph.description import WalkOptions, describe_graph
from snca_ros.nodes.interfaces import (
    NODES,
    RECORDER_NODE,
    SPIKES,
    STORAGES,
    VALUES,
    VIEW_NODE,
    VOXEL_NODE,
)
from snca_ros.nodes.live_view import ViewNode
from snca_ros.recording.streams import KINDS

VOXELS = 'voxel_0_0', 'voxel_0_1', 'voxel_1_1'
OF_ROS = {'/parameter_events': ['rcl_interfaces/msg/ParameterEvent']}
PARAMETERS_OF_ROS = {'use_sim_time', 'start_type_description_service'}


@pytest.fixture
def robot(ros, start_node, make_controller, tmp_path):
    """Return a function that starts a whole robot with recorder and view; its node names."""
    views = []

    def run(model):
        path = make_controller('11-10', model=model)
        trained = load_controller(path)
        options = WalkOptions(robot='robot', duration=0.0, bag=str(tmp_path / 'bag'))
        graph = describe_graph(path, trained, options)
        for process in graph.processes:
            start_node(graph, process)
        views.append(ViewNode('robot', trained, lambda frame: None))
        return {SIM_NODE: SIM_NODE.name, RECORDER_NODE: RECORDER_NODE.name,
                VOXEL_NODE: 'voxel_0_1', VIEW_NODE: VIEW_NODE.name}

    yield run
    for view in views:
        view.destroy_node()


def short(found):
    """Return types by the names of topics as they are declared, without namespace and voxel."""
    topics = {}
    for full_name, types in found:
        name = full_name.removeprefix('/robot/')
        voxel, _, rest = name.partition('/')
        name = PRESENCE.name if name.startswith(PRESENCE.name[:-1]) else name
        topics[rest if voxel in VOXELS else name] = types
    return topics


def types_of(topics, absent):
    return {topic.name: [topic.type] for topic in topics if topic != absent}


@pytest.mark.parametrize(('model', 'absent'), [('snn-h', VALUES), ('mlp', SPIKES)])
def test_topics_and_services_are_those_declared(robot, node, spin_until, model, absent):
    names = robot(model)

    def published(name):
        return short(node.get_publisher_names_and_types_by_node(name, '/robot'))

    def subscribed(name):
        found = short(node.get_subscriber_names_and_types_by_node(name, '/robot'))
        found.setdefault(PRESENCE.name, [PRESENCE.type])  # only while others are there
        if name == SIM_NODE.name:
            found.pop(CLOCK.name, None)  # only before it begins
        return found

    def served(name):
        services = node.get_service_names_and_types_by_node(name, '/robot')
        return {n.removeprefix('/robot/'): types for n, types in services if n.count('/') == 2}

    def as_many_as_declared():
        try:
            return all(
                len(served(name)) == len(interface.serves)
                and len(published(name)) > len(types_of(interface.publishes, absent))
                and len(subscribed(name)) + (interface is VOXEL_NODE)
                >= len(types_of({*interface.subscribes, PRESENCE}, absent))
                for interface, name in names.items()
            )
        except RuntimeError:  # rclpy's NodeNameNonExistentError: not known yet
            return False

    spin_until(as_many_as_declared)
    for interface, name in names.items():
        expected = types_of(interface.publishes, absent) | OF_ROS
        assert published(name) == expected, name
        expected = types_of({*interface.subscribes, PRESENCE}, absent)
        # A voxel stops to listen to its own actuation when it joins.
        joined = {k: v for k, v in expected.items() if k != 'actuation'}
        assert subscribed(name) in ([expected, joined] if interface is VOXEL_NODE else [expected])
        assert served(name) == {service.name: [service.type] for service in interface.serves}


def test_parameters_are_those_declared(robot, node, spin_until):
    names = robot('snn-h')
    for interface in (SIM_NODE, RECORDER_NODE, VOXEL_NODE):
        name = names[interface]

        def call(kind, service, request, name=name):
            client = node.create_client(kind, f'/robot/{name}/{service}')
            spin_until(client.service_is_ready)
            future = client.call_async(request)
            spin_until(future.done)
            node.destroy_client(client)
            return future.result()

        listed = call(ListParameters, 'list_parameters', ListParameters.Request()).result.names
        found = set(listed) - PARAMETERS_OF_ROS
        fields = {n: f for group in interface.parameters for n, f in group.fields.items()}
        assert {n for n in found if not n.startswith('qos_overrides.')} == set(fields)
        request = DescribeParameters.Request(names=list(fields))
        described = call(DescribeParameters, 'describe_parameters', request).descriptors
        for descriptor, f in zip(described, fields.values(), strict=True):
            assert descriptor.description == describe(f)
            assert descriptor.read_only
            ranges = [*descriptor.floating_point_range, *descriptor.integer_range]
            bounds = [(r.from_value, r.to_value) for r in ranges]
            declared = [(f.metadata['low'], f.metadata['high'])] if 'low' in f.metadata else []
            assert bounds == declared


def test_readers_of_bags_expect_the_types_that_are_declared():
    topics = {t.name.lstrip('/'): t for n in (SIM_NODE, *NODES) for t in n.publishes}
    for kind, reader in KINDS.items():
        assert (topics[kind].type, topics[kind].of_voxel) == (
            reader.type, reader.of_voxel
        ), kind


def test_every_topic_of_a_robot_is_recorded():
    sent = {t for n in (SIM_NODE, VOXEL_NODE, VIEW_NODE) for t in n.publishes}
    sent.remove(PRESENCE)  # a hidden topic
    assert sent <= set(RECORDER_NODE.subscribes)
    assert {DIAGNOSTICS, ROSOUT} <= set(RECORDER_NODE.subscribes)


def test_every_storage_has_a_plugin():
    assert sorted(plugin.name.lower() for plugin in StoragePlugin) == sorted(STORAGES)
