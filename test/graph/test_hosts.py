"""One robot on two hosts: two network namespaces, a virtual cable between them."""

import os
import re
import shutil
import subprocess
from collections import defaultdict

import numpy as np
import pytest
from support.limits import LIMIT
from support.processes import TICK, wait_until

from snca_ros.bundled import DEFAULT_CONTROLLER
from snca_ros.graph.environment import PROFILE_VARIABLES
from snca_ros.recording.bag import read_bag
from snca_ros.recording.outcomes import Outcome

pytestmark = pytest.mark.root


class Cable:
    """Two namespaces `hosts`, each with one end of a veth pair; needs root and iproute2."""

    def __init__(self) -> None:
        self.hosts = [f'snca{os.getpid()}{end}' for end in 'ab']
        self._ends = ['end0', 'end1']

    def lay(self) -> None:
        for host in self.hosts:
            _command('ip', 'netns', 'add', host)
        (a, b), (end_a, end_b) = self.hosts, self._ends
        _command('ip', 'link', 'add', end_a, 'netns', a, 'type', 'veth',
                 'peer', 'name', end_b, 'netns', b)
        for i, (host, end) in enumerate(zip(self.hosts, self._ends, strict=True)):
            _command('ip', '-n', host, 'addr', 'add', f'10.71.0.{i + 1}/24', 'dev', end)
            for link in ('lo', end):
                _command('ip', '-n', host, 'link', 'set', link, 'up')

    def remove(self) -> None:
        for host in self.hosts:
            subprocess.run(['ip', 'netns', 'del', host], check=False, capture_output=True)

    def prefix(self, i: int) -> list[str]:
        """Return the prefix of a command that runs it on host `i`."""
        return ['ip', 'netns', 'exec', self.hosts[i]]

    def lose(self, percent: int) -> None:
        """Drop packets at random in both directions, and every multicast."""
        for i, end in enumerate(self._ends):
            nft = [*self.prefix(i), 'nft']
            _command(*nft, 'add table inet cable')
            _command(*nft, 'add chain inet cable in { type filter hook input priority 0; }')
            on_cable = f'add rule inet cable in iifname {end}'
            _command(*nft, f'{on_cable} numgen random mod 100 < {percent} counter drop')
            _command(*nft, f'{on_cable} ip daddr 224.0.0.0/4 drop')

    def cut(self) -> None:
        """Disconnect the cable at one end."""
        _command('ip', '-n', self.hosts[1], 'link', 'set', self._ends[1], 'down')

    def mend(self) -> None:
        """Connect the cable again."""
        _command('ip', '-n', self.hosts[1], 'link', 'set', self._ends[1], 'up')

    def dropped(self) -> list[int]:
        """Return the packets that were dropped on the way to each host."""
        texts = [_command(*self.prefix(i), 'nft', 'list', 'ruleset') for i in (0, 1)]
        return [int(text.partition('packets ')[2].split()[0]) for text in texts]


def _command(*words: str) -> str:
    return subprocess.run(words, check=True, capture_output=True, text=True).stdout


@pytest.fixture
def cable(monkeypatch):
    for name in PROFILE_VARIABLES:  # set by conftest for the loopback interface
        monkeypatch.delenv(name, raising=False)
    cable = Cable()
    try:
        cable.lay()
    except (OSError, subprocess.CalledProcessError) as error:
        cable.remove()
        reason = getattr(error, 'stderr', '') or str(error)
        pytest.skip(f'no network namespaces, which need root and iproute2: {reason.strip()}')
    yield cable
    cable.remove()


def walk_on_two_hosts(cable, start, path, *options):
    """Walk 1.5 s, one voxel here, the others there; return the walk's output."""
    there = start('voxels', path, '--only', '2/2', *options, prefix=cable.prefix(1))
    here = start('walk', path, '--only', '1/2', '--duration', 1.5, '--bag', 'bag', *options,
                 prefix=cable.prefix(0))
    output, _ = here.communicate(timeout=LIMIT)
    assert here.returncode == 0, output
    remote_output, _ = there.communicate(timeout=LIMIT)  # ends when the walk does
    assert there.returncode == 0, remote_output
    assert '/robot_11_10: voxel_0_1, voxel_1_1\n' in remote_output
    assert '/robot_11_10: 1 voxels in 1 processes' in output
    return output


def test_walk_on_two_hosts_equals_the_walk_on_one(cable, start, make_controller):
    options = '--shape', '11-10', '--faults', 'loss=0.3,death=voxel_0_1@0.5-0.8'
    output = walk_on_two_hosts(cable, start, make_controller('11'), *options)
    assert '91 positions of the centre, bit for bit the same' in output


@pytest.mark.skipif(not shutil.which('nft'), reason='no nft; Debian, Ubuntu: apt install nftables')
def test_lost_packets_are_sent_again(cable, start, make_controller, monkeypatch):
    cable.lose(5)
    monkeypatch.setenv('ROS_STATIC_PEERS', '10.71.0.1;10.71.0.2')
    output = walk_on_two_hosts(cable, start, make_controller('11-10'))
    assert '91 positions of the centre, bit for bit the same' in output
    assert min(cable.dropped()) > 10


@pytest.mark.slow
def test_walk_in_real_time_survives_a_cut_cable(cable, start, make_controller, tmp_path):
    path = make_controller('11-10')
    there = start('voxels', path, '--only', '2/2', '--real-time', prefix=cable.prefix(1))
    here = start('walk', path, '--only', '1/2', '--real-time', '--duration', 6, '--bag', 'bag',
                 prefix=cable.prefix(0))
    bag = tmp_path / 'bag' / 'bag.mcap'
    wait_until(lambda: bag.exists() and bag.stat().st_size > 100_000)  # it walks
    cable.cut()
    TICK.wait(2.0)
    cable.mend()
    output, _ = here.communicate(timeout=LIMIT)
    assert here.returncode == 0, output
    remote_output, _ = there.communicate(timeout=LIMIT)
    assert there.returncode == 0, remote_output
    for voxel in ('voxel_0_1', 'voxel_1_1'):
        assert re.search(rf'limp, silent for .*{voxel}', output)
        assert f'{voxel} answers again' in output
    recording = read_bag(tmp_path / 'bag')
    assert recording.n_steps == 361
    on_time, late, lost = recording.health['sim_node'].deliveries['voxel_0_1/actuation']
    assert on_time + late + lost == 360
    assert late + lost > 60  # of the 120 steps of two seconds
    assert on_time > 100


def shares_lost(bag):
    """Return the shares of lost sensors, spikes and actuation, by whether they cross the cable."""
    counts = defaultdict(lambda: np.zeros(3, dtype=int))
    here = {'sim_node', *bag.voxel_names[: len(bag.voxel_names) // 2]}
    for node, health in bag.health.items():
        for topic, delivered in health.deliveries.items():
            sender, kind = topic.split('/')
            sender = 'sim_node' if kind == 'sensors' else sender
            counts[kind, sender in here, node in here] += delivered
    return {key: lost / (on_time + late + lost) for key, (on_time, late, lost) in counts.items()}


@pytest.mark.slow
@pytest.mark.skipif(not shutil.which('nft'), reason='no nft; Debian, Ubuntu: apt install nftables')
def test_biped_walks_over_a_cable_that_drops_30_percent(cable, start, tmp_path, monkeypatch):
    """Best effort: messages that are lost on the cable are counted there, and end nothing."""
    cable.lose(30)
    monkeypatch.setenv('ROS_STATIC_PEERS', '10.71.0.1;10.71.0.2')
    options = '--real-time', '--reliability', 'best_effort', '--voxels-per-process', 5
    there = start('voxels', DEFAULT_CONTROLLER, '--only', '2/2', *options, prefix=cable.prefix(1))
    here = start('walk', DEFAULT_CONTROLLER, '--only', '1/2', '--duration', 8, '--bag', 'bag',
                 *options, prefix=cable.prefix(0))
    output, _ = here.communicate(timeout=LIMIT)
    assert here.returncode == 0, output
    remote_output, _ = there.communicate(timeout=LIMIT)
    assert there.returncode == 0, remote_output
    assert 'ended with code' not in output + remote_output
    assert min(cable.dropped()) > 100
    bag = read_bag(tmp_path / 'bag')
    assert (bag.n_steps, len(bag.health)) == (481, 12)
    assert bag.centers[-1, 0] - bag.centers[0, 0] > 2.0
    lost = shares_lost(bag)
    assert 0.25 < lost['sensors', True, False] < 0.35
    assert 0.25 < lost['spikes', True, False] < 0.35
    # A voxel answers 70 % of the sensors, of which it receives 70 %.
    assert 0.45 < lost['actuation', False, True] < 0.57
    assert 0.45 < lost['spikes', False, True] < 0.57
    for kind in ('sensors', 'actuation', 'spikes'):
        assert lost[kind, True, True] < 0.05
    in_time = sum(count.in_time for count in bag.counts if count.kind == 'actuation')
    assert in_time == np.count_nonzero(bag.outcomes == Outcome.IN_TIME)
