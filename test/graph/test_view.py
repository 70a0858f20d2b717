"""A live walk: frames of a real graph, and real kills by the page's commands."""

import json
import re
import time

import numpy as np
from rclpy.parameter_client import AsyncParameterClient
from support.graph import offline
from support.limits import LIMIT
from support.processes import is_alive, nodes_of
from websockets.sync.client import connect


class Page:
    """The WebSocket client of the page, without a browser."""

    def __init__(self, socket):
        self.socket, self.frames = socket, []

    def look_until(self, condition):
        """Take frames until one meets a condition; return it."""
        end = time.monotonic() + LIMIT
        while time.monotonic() < end:
            self.frames.append(json.loads(self.socket.recv(timeout=LIMIT)))
            if condition(self.frames[-1]):
                return self.frames[-1]
        raise AssertionError('no frame meets the condition')

    def command(self, action, voxel='voxel_1_1'):
        self.socket.send(json.dumps({'action': action, 'voxel': voxel}))


def origin_of(walk):
    said = iter(walk.stdout.readline, '')
    return next(found[1] for line in said if (found := re.search(r'(http://\S+)/$', line)))


def is_silent(frame):
    return frame['health'].get('sim_node', ['', ''])[1] == 'silent: voxel_1_1'


def level(frame):
    return frame['health'].get('voxel_1_1', [0])[0]


def test_a_live_walk_is_seen_and_its_voxels_are_killed_and_revived(
    start, make_controller, node, spin_until
):
    path = make_controller('11-10')
    walk = start('walk', path, '--port', 0, '--duration', 900, '--no-bag')
    origin = origin_of(walk)
    with connect(origin.replace('http', 'ws'), origin=origin) as socket:
        watch_and_disturb(walk, Page(socket), offline(path, 1.0), node, spin_until)


def watch_and_disturb(walk, page, twin, node, spin_until):
    seen = page.look_until(lambda frame: frame['step'] >= 30)
    assert np.reshape(seen['corners'], (3, 4, 2))[..., 1].min() > 4.9  # on the ground
    first = page.frames[0]
    np.testing.assert_allclose([first['x'], first['y']], twin[first['step']], atol=0.5)
    said = {(step, voxel) for frame in page.frames for step, voxel, _ in frame['messages']}
    assert {(step, voxel) for step in range(20) for voxel in range(3)} <= said

    page.command('dance')
    page.command('kill', 'nobody')
    victim = nodes_of(walk.pid)['voxel_1_1']
    page.command('kill')
    page.look_until(lambda frame: level(frame) == 2)
    assert not is_alive(victim)
    page.look_until(is_silent)

    page.command('revive')
    page.look_until(lambda frame: frame['health']['voxel_1_1'][1].startswith('step'))
    revived = nodes_of(walk.pid)['voxel_1_1']
    assert revived != victim

    page.command('noise')
    page.look_until(lambda frame: level(frame) == 2)
    page.look_until(lambda frame: frame['health']['voxel_1_1'][1].startswith('step'))
    disturbed = nodes_of(walk.pid)['voxel_1_1']
    assert disturbed != revived
    assert not is_alive(revived)
    parameters = AsyncParameterClient(node, '/robot_11_10/voxel_1_1')
    spin_until(parameters.services_are_ready)
    answer = parameters.get_parameters(['loss'])
    spin_until(answer.done)
    assert answer.result().values[0].double_value == 0.5


def test_invalid_messages_do_not_end_a_walk_with_a_view(start, attack, make_controller):
    walk = start('walk', make_controller('11-10'), '--port', 0, '--duration', 900, '--no-bag')
    origin = origin_of(walk)
    attack('/robot_11_10')
    said = iter(walk.stdout.readline, '')
    assert any('.view]' in line and ': refused: ' in line for line in said), 'the walk has ended'
    # Like a browser it sends no pings of its own: a flooded machine may answer them late.
    with connect(origin.replace('http', 'ws'), origin=origin, ping_interval=None) as socket:
        page = Page(socket)
        begin = page.look_until(lambda frame: True)['step']
        page.look_until(lambda frame: frame['step'] > begin + 30)
