import threading

import pytest

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
def test_goes_on_at_once(interfaces, states, capfd):
    await_network(interfaces(**states), patience=0.0)
    assert capfd.readouterr().err == ''


def test_says_which_interfaces_do_not_run(interfaces, capfd):
    await_network(interfaces(lo='unknown', wlan0='dormant', eth0='down'), patience=0.0)
    assert capfd.readouterr().err == 'no network: of eth0, wlan0 none runs; going on without\n'


def test_waits_until_one_runs(interfaces, capfd):
    folder = interfaces(eth0='down')
    waiting = threading.Thread(target=await_network, args=(folder, 60.0))
    waiting.start()
    assert waiting.is_alive()
    (folder / 'eth0' / 'operstate').write_text('up\n')
    waiting.join(60.0)
    assert not waiting.is_alive()
    assert capfd.readouterr().err == ''
