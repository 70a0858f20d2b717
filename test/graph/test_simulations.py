"""Of several simulations in a namespace one has precedence; a killed one has none."""

from types import SimpleNamespace

import pytest
from std_msgs.msg import String

from sim_node.ros import simulations
from sim_node.ros.simulations import Simulations


class FakeNode:
    """A node in /robot whose graph has the simulations `live`."""

    def __init__(self, *live):
        self.live, self.callbacks = list(live), {}

    def resolve_topic_name(self, name):
        return f'/robot/{name}'

    def count_publishers(self, topic):
        return self.live.count(topic.removeprefix('/robot/_simulation_'))

    def get_topic_names_and_types(self):
        names = [f'/robot/_simulation_{identity}' for identity in self.live]
        return [(name, ['std_msgs/msg/String']) for name in [*names, '/other/_simulation_0000']]

    def get_publishers_info_by_topic(self, topic):
        return [SimpleNamespace(node_namespace='/robot', node_name='sim_node')]

    def create_subscription(self, kind, topic, callback, qos):
        identity = topic.removeprefix('_simulation_')
        self.callbacks[identity] = callback
        return identity

    def destroy_subscription(self, identity):
        del self.callbacks[identity]


@pytest.mark.parametrize(('own', 'other', 'heard', 'silent', 'expected'), [
    ('bbbb', 'aaaa', 'starting', False, True),
    ('bbbb', 'cccc', 'starting', False, False),
    ('bbbb', 'cccc', 'running', False, True),
    ('bbbb', 'cccc', '', False, True),  # it may run
    ('bbbb', 'aaaa', 'running', True, False),  # it was killed
    ('bbbb', 'aaaa', '', True, False),
    ('', 'aaaa', 'starting', False, True),  # a node without simulation waits for any
    ('', 'aaaa', 'running', False, True),
])
def test_which_simulation_has_precedence(monkeypatch, own, other, heard, silent, expected):
    now = [100.0]
    monkeypatch.setattr(simulations.time, 'monotonic', lambda: now[0])
    node = FakeNode(*filter(None, [own, other]))
    found = Simulations(node, own)
    found.with_precedence()  # listens from now on
    assert set(node.callbacks) == {other}
    if heard:
        node.callbacks[other](String(data=f'host:17 {heard}'))
    now[0] += 4.0 if silent else 2.0
    who = found.with_precedence()
    assert who == ('' if not expected else '/robot/sim_node' + (' (host:17)' if heard else ''))
    node.live.remove(other)
    assert found.with_precedence() == ''
    assert not node.callbacks, 'it still listens to a simulation that is gone'
