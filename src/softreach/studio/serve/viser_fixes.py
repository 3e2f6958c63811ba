"""Fixes of viser and of its page: the one file that uses names which viser keeps to itself.

Each goes when `tests/studio/test_viser_fixes.py` says that viser no longer needs it. Where a name
is missing, what it was for is left out; only requests that cannot be checked end the start.
The upper pin of viser in `pyproject.toml` is there for this file.
"""

from __future__ import annotations

import gzip
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import cache, lru_cache
from http import HTTPStatus
from importlib.resources import files
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from viser import ViserServer

__all__ = [
    "close_sockets",
    "guarding",
    "headed",
    "headed_body",
    "request_path",
    "without_tunnel",
]

_starting = threading.Lock()


@contextmanager
def guarding(
    refusal: Callable[[str, Mapping[str, str]], str],
    answer: Callable[[str, Mapping[str, str]], Mapping[str, str]],
) -> Iterator[threading.Event]:
    """A server that starts inside the block checks every request, page and socket alike.

    viser offers no public way to see a request, to refuse it, or to send headers with its page.

    Args:
        refusal: Why a request, given by its path and headers, gets 403; "" for a welcome one.
        answer: Headers of what is sent for a request.

    Yields:
        Set once a server has taken the checks over; else it has none of them.
    """
    import websockets.asyncio.server as sockets

    plain, taken = getattr(sockets, "serve", None), threading.Event()

    def add(connection: Any, request: Any, response: Any) -> None:
        del connection
        for name, value in answer(request.path, request.headers).items():
            response.headers[name] = value
        if response.headers.get("Content-Type", "").startswith("text/html"):
            zipped = response.headers.get("Content-Encoding") == "gzip"
            response.body = headed_body(response.body, zipped=zipped)
            del response.headers["Content-Length"]
            response.headers["Content-Length"] = str(len(response.body))

    def serve(*arguments: Any, process_request: Any = None, **options: Any) -> Any:
        def admit(connection: Any, request: Any) -> Any:
            if reason := refusal(request.path, request.headers):
                return connection.respond(HTTPStatus.FORBIDDEN, reason)
            return process_request(connection, request) if process_request else None

        taken.set()
        assert plain is not None
        return plain(*arguments, process_request=admit, process_response=add, **options)

    if plain is None:
        yield taken
        return
    with _starting:
        sockets.serve = serve  # pyright: ignore[reportAttributeAccessIssue]
        try:
            yield taken
        finally:
            sockets.serve = plain


def request_path(server: ViserServer, client_id: int) -> str:
    """Address in the request of a page's socket, from the first slash on; "/" if unknown."""
    connections = getattr(_sockets(server), "_live_connections", {})
    request = getattr(connections.get(client_id), "request", None)
    return "/" if request is None else request.path


def close_sockets(server: ViserServer) -> None:
    """Close the sockets of all tabs; without a way to do so the server's end closes them."""
    close = getattr(_sockets(server), "disconnect_all_clients", None)
    if close is not None:
        close()


def _sockets(server: ViserServer) -> Any:
    return getattr(server, "_websock_server", None)


def without_tunnel(server: ViserServer) -> None:
    """Refuse a public address: any client could ask for one, the button is not the only way."""

    def refuse(*_: Any, **__: Any) -> None:
        return None

    server.request_share_url = refuse


# The head of viser's page: our title, `page.css` and `page.js`.

_THEIRS = "<title>Viser</title>"


@cache
def _head() -> str:
    style, script = (
        files(__package__ or "").joinpath(name).read_text(encoding="utf-8")
        for name in ("page.css", "page.js")
    )
    return f"<title>softreach</title><style>{style}</style><script>{script}</script>"


def headed(page: str) -> str:
    """A page with our head; one without viser's title as it is."""
    return page.replace(_THEIRS, _head(), 1)


@lru_cache(maxsize=4)
def headed_body(body: bytes, *, zipped: bool) -> bytes:
    """Bytes of a page with our head; those of anything else as they are."""
    content = gzip.decompress(body) if zipped else body
    ours = content.replace(_THEIRS.encode(), _head().encode(), 1)
    if ours == content:
        return body
    return gzip.compress(ours) if zipped else ours
