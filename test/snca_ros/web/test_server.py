"""The server of the live page: the requests that it refuses, and its page in a browser."""

import http.client
import json
from logging import ERROR
from socket import SHUT_RDWR
from urllib.parse import urlsplit

import numpy as np
import pytest
from support.limits import LIMIT
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from sim_node.errors import InvalidInput
from sim_node.model.morphology import parse_morphology
from sim_node.model.terrain import parse_terrain
from snca_ros.cell.architecture import Architecture
from snca_ros.trained_controller import TrainedController
from snca_ros.web.page import live_page
from snca_ros.web.server import PageServer, check_port

ARCHITECTURE = Architecture.named('U-nD', 'snn-h')
TRAINED = TrainedController(
    ARCHITECTURE, parse_morphology('11-10'), np.zeros(ARCHITECTURE.n_parameters(3))
)


@pytest.fixture
def server():
    server = PageServer(0, live_page(TRAINED, parse_terrain('flat'), 'live & well'))
    yield server
    server.close()


def ask(server, path='/', **headers):
    """Return status and body of a GET."""
    connection = http.client.HTTPConnection(urlsplit(server.address).netloc, timeout=LIMIT)
    try:
        connection.request('GET', path, headers=headers)
        response = connection.getresponse()
        return response.status, response.read().decode()
    finally:
        connection.close()


def open_socket(server, origin):
    return connect(server.address.replace('http', 'ws'), origin=origin, open_timeout=LIMIT)


def frame(step, **changes):
    """Return a frame of a robot that walks at 3 m/s."""
    x = 20.0 + step / 20.0
    square = np.array([[0.0, 3.0], [3.0, 3.0], [3.0, 0.0], [0.0, 0.0]])
    corners = [square + np.array([x + i, 5.0 + j]) for i, j in ((0, 0), (0, 3), (3, 3))]
    return {
        'step': step, 'x': x, 'y': 9.0, 'corners': np.ravel(corners).tolist(),
        'area': [1.0] * 3, 'touch': [1.0, 0.0, 0.0], 'actuation': [0.0] * 3, 'health': {},
        'messages': [[k, i, [3, 0, 0, 0]] for k in range(max(step - 2, 0), step) for i in range(3)],
        'ages': [[k, [0, 0, 0]] for k in range(max(step - 2, 0), step)],
        **changes,
    }


def test_only_its_own_page_is_served(server):
    assert server.address.startswith('http://127.0.0.1:')
    status, body = ask(server)
    assert status == 200
    assert '<title>live &amp; well</title>' in body
    assert ask(server, '/etc/passwd')[0] == 404
    assert ask(server, Host='evil.example')[0] == 403


@pytest.mark.parametrize('origin', ['http://evil.example', 'http://127.0.0.1:1', 'null', None])
def test_foreign_origins_are_refused(server, origin):
    with pytest.raises(InvalidStatus) as refused:
        open_socket(server, origin)
    assert refused.value.response.status_code == 403


def test_frames_are_sent_and_commands_received(server):
    with open_socket(server, server.address.rstrip('/')) as socket:
        socket.send('{"action": "kill"}')
        assert server.commands.get(timeout=LIMIT) == {'action': 'kill'}
        server.send({'step': 1})
        assert json.loads(socket.recv(timeout=LIMIT)) == {'step': 1}


@pytest.mark.parametrize('text', ['no json', '[' * 5000])
def test_a_client_that_sends_nonsense_is_disconnected_and_others_are_not(server, text):
    with open_socket(server, server.address.rstrip('/')) as other:
        with open_socket(server, server.address.rstrip('/')) as socket:
            socket.send(text)
            with pytest.raises(ConnectionClosed):
                socket.recv(timeout=LIMIT)
        other.send('{}')
        assert server.commands.get(timeout=LIMIT) == {}


def test_a_port_in_use_is_refused(server):
    port = urlsplit(server.address).port
    for use in (check_port, lambda port: PageServer(port, '')):
        with pytest.raises(InvalidInput, match=r'in use.*expected a port that is free'):
            use(port)
    check_port(0)


def test_a_connection_lost_without_a_close_frame_is_no_error(server, caplog):
    with open_socket(server, server.address[:-1]) as socket:
        socket.send('{}')
        assert server.commands.get(timeout=LIMIT) == {}
        socket.socket.shutdown(SHUT_RDWR)
    server.close()  # waits for the task that serves the connection
    assert [record.getMessage() for record in caplog.records if record.levelno >= ERROR] == []


def test_the_page_follows_a_walk_and_commands(server, browser):
    page, messages = browser.new_page(), []
    page.set_default_timeout(1000 * LIMIT)
    page.on('console', lambda message: messages.append(message.text))
    page.on('pageerror', lambda error: messages.append(str(error)))
    with page.expect_websocket() as opened:
        page.goto(server.address)
    page.wait_for_function('document.getElementById("state").textContent === ""')
    assert opened.value.url == server.address.replace('http', 'ws')
    for step in range(0, 122, 2):
        server.send(frame(step))
    page.wait_for_function('window.player?.time === 2')
    state = page.evaluate('player.state()')
    assert (state['x'], state['y']) == (26.0, 9.0)
    assert state['v_x'] == pytest.approx(3.0)
    assert page.evaluate('player.walk.at("rate", player.walk.frames - 1, 1)') == 30.0  # of 4 rows
    assert page.is_disabled('#kill')
    place = page.evaluate('middle(player.stage.shapes[1])')
    page.locator('#stage').click(position={'x': place[0], 'y': place[1]})
    for action in ('kill', 'revive', 'noise'):
        page.click(f'#{action}')
        wanted = {'action': action, 'voxel': 'voxel_0_1'}
        assert server.commands.get(timeout=LIMIT) == wanted
    page.keyboard.press('Home')
    server.send(frame(122, health={'voxel_0_1': [2, 'killed']}))
    page.wait_for_function('player.walk.duration > 2')
    assert page.evaluate('player.time') == 0  # after seeking it stays there
    assert page.text_content('#node') == 'voxel_0_1: killed'
    server.close()
    page.wait_for_function('document.getElementById("state").textContent !== ""')
    page.close()
    assert messages == []
