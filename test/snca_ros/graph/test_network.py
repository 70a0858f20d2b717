import threading

import pytest
from support.limits import LIMIT

from snca_ros.graph.network import await_network


@pytest.fixture
def interfaces(tmp_path):
    def make(**states):
        for name, state in states.items():
            (tmp_path / name).mkdir()
            (tmp_path / name / 'operstate').write_text(f'{state}\n')
        return tmp_path

    return make


@pytest.mark.parametrize('states', [
    {'lo': 'unknown'}, {'lo': 'unknown', 'eth0': 'down', 'wlan0': 'up'}, {'tun0': 'unknown'}, {},
])
def test_returns_at_once_if_an_interface_is_up_or_there_is_none(interfaces, states, capfd):
    await_network(interfaces(**states), patience=0.0)
    assert capfd.readouterr().err == ''


def test_names_the_interfaces_that_are_down(interfaces, capfd):
    await_network(interfaces(lo='unknown', wlan0='dormant', eth0='down'), patience=0.0)
    expected = 'no network interface is up (eth0, wlan0); starting anyway\n'
    assert capfd.readouterr().err == expected


def test_waits_until_an_interface_is_up(interfaces, capfd):
    folder = interfaces(eth0='down')
    waiting = threading.Thread(target=await_network, args=(folder, LIMIT))
    waiting.start()
    assert waiting.is_alive()
    (folder / 'eth0' / 'operstate').write_text('up\n')
    waiting.join(LIMIT)
    assert not waiting.is_alive()
    assert capfd.readouterr().err == ''
