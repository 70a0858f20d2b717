"""Serves a page and a WebSocket on the loopback interface, in its own thread."""

import asyncio
import json
import os
import socket
import threading
from http import HTTPStatus
from queue import SimpleQueue
from typing import Any

from websockets.asyncio.server import ServerConnection, broadcast, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from sim_node.errors import InvalidInput

HOST = '127.0.0.1'
_MAX_COMMAND = 1000  # bytes


def check_port(port: int) -> None:
    """Raise InvalidInput if no page can be served at `port`."""
    with socket.socket() as listener:
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listener.bind((HOST, port))
        except OSError as error:
            raise _not_free(port, error) from None


def _not_free(port: int, error: OSError) -> InvalidInput:
    reason = os.strerror(error.errno or 0)
    return InvalidInput('port', f'{port}: {reason}', 'a port that is free')


class PageServer:
    """Serves one page at `address`, and exchanges JSON messages with it over a WebSocket.

    It refuses requests with another Host header, which DNS rebinding would cause, and WebSockets
    from pages of another origin.

    Args:
        port: to listen on; 0 for a free one.
        page: HTML of the page.

    Attributes:
        address: URL of the page.
        commands: JSON objects that pages have sent, oldest first.

    Raises:
        InvalidInput: the port is not available.
    """

    def __init__(self, port: int, page: str) -> None:
        self.commands: SimpleQueue[dict[str, Any]] = SimpleQueue()
        self._page, self._clients = page, set[ServerConnection]()
        self._loop, self._stop = asyncio.new_event_loop(), asyncio.Event()
        listening: SimpleQueue[int | OSError] = SimpleQueue()
        self._thread = threading.Thread(
            target=self._loop.run_until_complete, args=[self._serve(port, listening)], daemon=True
        )
        self._thread.start()
        if isinstance(found := listening.get(), OSError):
            raise _not_free(port, found)
        self._hosts = f'{HOST}:{found}', f'localhost:{found}'
        self.address = f'http://{self._hosts[0]}/'

    async def _serve(self, port: int, listening: 'SimpleQueue[int | OSError]') -> None:
        try:
            server = await serve(
                self._receive, HOST, port, process_request=self._answer, max_size=_MAX_COMMAND
            )
        except OSError as error:
            listening.put(error)
            return
        async with server:
            listening.put(server.sockets[0].getsockname()[1])
            await self._stop.wait()

    def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        """Return the page, or None to accept a WebSocket."""
        if request.headers.get('Host') not in self._hosts:
            return connection.respond(HTTPStatus.FORBIDDEN, 'another host\n')
        if 'Upgrade' in request.headers:
            origins = [f'http://{host}' for host in self._hosts]
            if request.headers.get('Origin') not in origins:
                return connection.respond(HTTPStatus.FORBIDDEN, 'another origin\n')
            return None
        if request.path != '/':
            return connection.respond(HTTPStatus.NOT_FOUND, 'the page is at /\n')
        body = self._page.encode()
        headers = Headers({
            'Content-Type': 'text/html; charset=utf-8', 'Content-Length': str(len(body)),
            'Cache-Control': 'no-store', 'Connection': 'close', 'X-Frame-Options': 'DENY',
        })
        return Response(HTTPStatus.OK, 'OK', headers, body)

    async def _receive(self, client: ServerConnection) -> None:
        self._clients.add(client)
        try:
            async for text in client:
                command = json.loads(text)
                if isinstance(command, dict):
                    self.commands.put(command)
        except ValueError:
            await client.close(1003, 'no JSON')
        except ConnectionClosed:  # by the browser, without a close frame
            pass
        finally:
            self._clients.discard(client)

    def send(self, message: dict[str, Any]) -> None:
        """Send `message` as JSON to all open pages, without waiting for slow ones."""
        text = json.dumps(message)
        self._loop.call_soon_threadsafe(lambda: broadcast(self._clients, text))

    def close(self) -> None:
        """Close all connections and the port; a second call does nothing."""
        if self._loop.is_closed():
            return
        self._loop.call_soon_threadsafe(self._stop.set)
        self._thread.join()
        self._loop.close()
