"""The sockets behind the tabs: the one place that uses names which viser keeps to itself.

viser offers no public way to see the request of a socket, to refuse it, to close all of them, or to
send headers with its page.
The upper pin of viser in `pyproject.toml` is there for this file; a test tells when it can go.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

from softreach.studio.head import headed_body
from softreach.studio.token import cookie, is_welcome

if TYPE_CHECKING:
    from viser import ViserServer

__all__ = ["asked_path", "close_all", "refuse_unless", "sending_headers"]

_FORBIDDEN = "The address lacks the token that softreach printed with it.\n"
_starting = threading.Lock()


def asked_path(server: ViserServer, client_id: int) -> str:
    """The address that the socket of a page asked for, from the first slash on."""
    live = server._websock_server._live_connections.get(client_id)
    request = live.request if live is not None else None
    return "/" if request is None else request.path


def close_all(server: ViserServer) -> None:
    """Close the sockets of all tabs."""
    server._websock_server.disconnect_all_clients()


def refuse_unless(server: ViserServer, welcome: Callable[[Any], bool]) -> None:
    """Close every socket whose headers are not welcome before anything is sent to it."""
    sockets = server._websock_server

    @sockets.on_client_connect
    async def _(client: Any) -> None:
        live = sockets._live_connections[client.client_id]
        request = live.request
        if request is None or not welcome(request.headers):
            await live.close(1008, "not our page")


@contextmanager
def sending_headers(headers: Callable[[str], Mapping[str, str]], token: str = "") -> Iterator[None]:
    """A server that starts inside the block sends these headers with everything, and our title.

    Args:
        headers: From the host that was asked for, as the request names it.
        token: What requests have to show, pages and sockets alike; all others get 403.
    """
    import websockets.asyncio.server as sockets

    plain = sockets.serve

    def add(connection: Any, request: Any, response: Any) -> None:
        del connection
        for name, value in headers(request.headers.get("Host", "")).items():
            response.headers[name] = value
        if kept := cookie(request.path, token):
            response.headers["Set-Cookie"] = kept
        if response.headers.get("Content-Type", "").startswith("text/html"):
            zipped = response.headers.get("Content-Encoding") == "gzip"
            response.body = headed_body(response.body, zipped=zipped)
            del response.headers["Content-Length"]
            response.headers["Content-Length"] = str(len(response.body))

    def serve(*arguments: Any, process_request: Any = None, **options: Any) -> Any:
        def admit(connection: Any, request: Any) -> Any:
            if not is_welcome(request.path, request.headers, token):
                return connection.respond(HTTPStatus.FORBIDDEN, _FORBIDDEN)
            return process_request(connection, request) if process_request else None

        return plain(*arguments, process_request=admit, process_response=add, **options)

    with _starting:
        sockets.serve = serve  # pyright: ignore[reportAttributeAccessIssue]
        try:
            yield
        finally:
            sockets.serve = plain
