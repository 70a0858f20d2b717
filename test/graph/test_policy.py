"""SROS 2: the policy allows what nodes use and nothing else; no graph is open by mistake."""

import re
from pathlib import Path

import pytest
from lxml import etree
from support.limits import LIMIT

from sim_node.ros import security
from snca_ros.controller_file import load_controller
from snca_ros.graph.description import WalkOptions, describe_graph
from snca_ros.graph.processes import RunningGraph
from snca_ros.graph.sros_policy import policy_xml

AT_TIMES = {
    # a voxel listens for a duplicate until it takes part
    'subscribe': [('voxel', '/robot/{}/actuation'), ('voxel', '/robot/_simulation_*'),
                  ('sim', '/robot/_simulation_*'), ('sim', '/clock'), ('recorder', '/robot/clock')],
    'publish': [('sim', '/robot/clock')],  # if another node publishes /clock
}
"""What nodes use only in some situations: topics by beginnings of the nodes' names."""

SCHEMA = etree.XMLSchema(etree.parse(str(Path(__file__).parent / 'policy.xsd')))


def allowed(policy):
    """Return {(node, what): full names} of a policy."""
    access = {}
    for profile in policy.iter('profile'):
        ns, node = profile.get('ns'), profile.get('node')
        for group in profile:
            for verb in group.attrib:
                names = access.setdefault((node, verb), set())
                for element in group:
                    name = element.text.replace('~', f'{ns}/{node}')
                    names.add(name if name.startswith('/') else f'{ns}/{name}')
    return access


def used(node, name):
    """Return {(node, what): full names} of a running node, as another one sees it."""
    ask = {
        'publish': node.get_publisher_names_and_types_by_node,
        'subscribe': node.get_subscriber_names_and_types_by_node,
        'reply': node.get_service_names_and_types_by_node,
    }
    if (name, '/robot') not in node.get_node_names_and_namespaces():
        return {}
    access = {
        (name, verb): {re.sub('_simulation_.*', '_simulation_*', t) for t, _ in of(name, '/robot')}
        for verb, of in ask.items()
    }
    for verb, topics in AT_TIMES.items():
        access[name, verb] |= {t.format(name) for kind, t in topics if name.startswith(kind)}
    return access


def test_policy_allows_what_nodes_do_and_no_more(make_controller, node, spin_until, tmp_path):
    path = make_controller('11-10', 'U-nD', 'mlp')
    options = WalkOptions(
        robot='robot', bag=str(tmp_path / 'bag'), simulation={'start_paused': True}
    )
    graph = describe_graph(path, load_controller(path), options)
    policy = etree.fromstring(policy_xml(graph, 'values').encode())
    SCHEMA.assertValid(policy)
    names = [process.name for process in graph.processes]
    expected = {k: v for k, v in allowed(policy).items() if k[0] in names}
    seen = {}

    def look():
        seen.clear()
        for name in names:
            seen.update(used(node, name))
        return seen == expected

    with RunningGraph(graph, {}):
        try:
            spin_until(look)
        except AssertionError:
            assert seen == expected  # shows where they differ


def test_voxels_have_enclaves_and_may_subscribe_only_to_neighbours(start, make_controller):
    path = make_controller('11', 'U-nD', 'snn')
    child = start('policy', path, '--shape', '111', '--robot', 'trio')
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 0
    policy = etree.fromstring(output.encode())
    SCHEMA.assertValid(policy)
    nodes = ['recorder_node', 'sim_node', 'voxel_0_0', 'voxel_1_0', 'voxel_2_0', 'walk', 'voxels']
    assert [e.get('path') for e in policy.iter('enclave')] == [f'/trio/{name}' for name in nodes]
    access = allowed(policy)
    assert access['voxel_0_0', 'subscribe'] == {
        '/trio/voxel_0_0/sensors', '/trio/voxel_0_0/actuation', '/trio/voxel_1_0/spikes',
        '/trio/_simulation_*',
    }
    assert access['voxel_2_0', 'publish'] == {
        '/trio/voxel_2_0/actuation', '/trio/voxel_2_0/spikes',
        '/rosout', '/diagnostics', '/parameter_events',
    }


def test_processes_of_several_voxels_share_an_enclave(start, make_controller):
    child = start('policy', make_controller('111', 'U-nD', 'snn'), '--voxels-per-process', 2)
    output, _ = child.communicate(timeout=LIMIT)
    policy = etree.fromstring(output.encode())
    profiles = {e.get('path'): [p.get('node') for p in e.iter('profile')]
                for e in policy.iter('enclave')}
    assert profiles['/robot_111/voxel_0_0'] == ['voxel_0_0', 'voxel_1_0']
    assert profiles['/robot_111/voxel_2_0'] == ['voxel_2_0']


@pytest.mark.parametrize('command', ['walk', 'sim_node'])
def test_security_that_cannot_be_had_is_refused(start, tmp_path, monkeypatch, command):
    (tmp_path / 'enclaves').mkdir()
    monkeypatch.setenv(security.ENABLE, 'true')
    monkeypatch.setenv(security.STRATEGY, 'Enforce')
    monkeypatch.setenv(security.KEYSTORE, str(tmp_path))
    child = start(command)
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 2, output
    assert 'Traceback' not in output
    assert 'docs/security.md' in output
    assert 'walked' not in output


def test_keystore_that_is_missing_is_named(start, monkeypatch):
    monkeypatch.setenv(security.ENABLE, 'true')
    monkeypatch.setenv(security.STRATEGY, 'Enforce')
    child = start('sim_node')
    output, _ = child.communicate(timeout=LIMIT)
    assert child.returncode == 2, output
    (line,) = [line for line in output.splitlines() if 'error: ' in line]
    assert security.KEYSTORE in line
