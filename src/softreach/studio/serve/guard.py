"""Requests that the server answers, and our part of its page; names that viser keeps to itself.

viser offers no public way to see a request, to refuse it, or to send headers with its page. Where
requests cannot be checked, the server does not start. A second server in front of viser's would
leave viser's own port open to every page and program of this machine.
"""

from __future__ import annotations

import gzip
import hmac
import re
import secrets
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from functools import cache, lru_cache
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from importlib.resources import files
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

if TYPE_CHECKING:
    from viser import ViserServer

__all__ = ["close_sockets", "guarding", "headed", "new_token", "refusal", "without_tunnel"]

LOCAL = ("localhost", "127.0.0.1", "::1")

_COOKIE = "softreach_token"
_NO_TOKEN = "The address lacks the token that softreach printed with it.\n"
_FOREIGN = "This page is for its own server alone.\n"
_ELSEWHERE = "This address names another server, to which the page may not connect.\n"


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(18)


def refusal(host: str, token: str, path: str, headers: Mapping[str, str]) -> str:
    """Reason why a request is refused; "" for one that is welcome.

    Args:
        host: That the server listens on.
        token: That a request shows in its address, or in the cookie that it got for that; "" for
            none.
        path: Of the request, with its query.
        headers: Of the request.
    """
    if token and not any(map(_is(token), _shown_tokens(path, headers))):
        return _NO_TOKEN
    if not same_origin(headers, host):
        return _FOREIGN
    sockets = parse_qs(urlsplit(path).query).get("websocket", [])
    own = headers.get("Host", "")
    return "" if all(_place(socket) == own for socket in sockets) else _ELSEWHERE


def _is(token: str) -> Any:
    return lambda shown: hmac.compare_digest(shown.encode(), token.encode())


def _shown_tokens(path: str, headers: Mapping[str, str]) -> list[str]:
    shown = parse_qs(urlsplit(path).query).get("token", [])
    try:
        kept = SimpleCookie(headers.get("Cookie", "")).get(_COOKIE)
    except CookieError:
        return shown
    return shown if kept is None else [*shown, kept.value]


def _place(address: str) -> str:
    """Name and port in an address; "" if it is none."""
    try:
        return urlsplit(address).netloc
    except ValueError:
        return ""


def same_origin(headers: Mapping[str, str], host: str) -> bool:
    """True if a connection comes from our own page, or from no page at all.

    Browsers let any web page open a socket to this machine; they tell where it came from. On
    loopback the name must be local too, as foreign names can be made to point here.
    """
    page = urlsplit(f"//{headers.get('Host', '')}")
    if host in LOCAL and page.hostname not in LOCAL:
        return False
    origin = headers.get("Origin")
    return origin is None or urlsplit(origin).netloc == page.netloc


def answer_headers(token: str, path: str, headers: Mapping[str, str]) -> dict[str, str]:
    """Headers of the answer to a request, with a cookie where its address shows the token."""
    answer = page_headers(headers.get("Host", ""))
    if token and "token" in parse_qs(urlsplit(path).query):
        answer["Set-Cookie"] = f"{_COOKIE}={token}; Path=/; HttpOnly; SameSite=Lax"
    return answer


def page_headers(host: str) -> dict[str, str]:
    """Headers that keep a page to its own server, whatever its address says.

    viser's page is one file of inline scripts and styles; it would open a socket to any server that
    `?websocket=` names, and read a scene from any address.

    Args:
        host: Name and port, as the request has them.
    """
    plain = _HOST.fullmatch(host) is not None
    sockets = f" ws://{host} wss://{host}" if plain else ""  # older browsers: not part of 'self'
    rules = _POLICY | {"connect-src": f"'self' data: blob:{sockets}"}
    return {
        "Content-Security-Policy": "; ".join(f"{name} {value}" for name, value in rules.items()),
        "X-Frame-Options": "DENY",
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
    }


_HOST = re.compile(r"[A-Za-z0-9.\-]+(:\d+)?|\[[0-9A-Fa-f:.]+\](:\d+)?")
_POLICY = {
    "default-src": "'self'",
    "script-src": "'self' 'unsafe-inline' 'unsafe-eval' blob:",
    "script-src-attr": "'none'",
    "style-src": "'self' 'unsafe-inline'",
    "img-src": "'self' data: blob:",
    "font-src": "'self' data:",
    "media-src": "'none'",
    "worker-src": "'self' blob: data:",
    "frame-src": "'none'",
    "object-src": "'none'",
    "base-uri": "'none'",
    "form-action": "'none'",
    "frame-ancestors": "'none'",
}

_starting = threading.Lock()


@contextmanager
def guarding(host: str, token: str) -> Iterator[threading.Event]:
    """A server that starts inside the block checks every request, page and socket alike.

    Yields:
        Set once a server has taken the checks over; else it has none of them.
    """
    import websockets.asyncio.server as sockets

    plain, taken = sockets.serve, threading.Event()

    def add(connection: Any, request: Any, response: Any) -> None:
        del connection
        for name, value in answer_headers(token, request.path, request.headers).items():
            response.headers[name] = value
        if response.headers.get("Content-Type", "").startswith("text/html"):
            zipped = response.headers.get("Content-Encoding") == "gzip"
            response.body = headed(response.body, zipped=zipped)
            del response.headers["Content-Length"]
            response.headers["Content-Length"] = str(len(response.body))

    def serve(*arguments: Any, process_request: Any = None, **options: Any) -> Any:
        def admit(connection: Any, request: Any) -> Any:
            if reason := refusal(host, token, request.path, request.headers):
                return connection.respond(HTTPStatus.FORBIDDEN, reason)
            return process_request(connection, request) if process_request else None

        taken.set()
        return plain(*arguments, process_request=admit, process_response=add, **options)

    with _starting:
        sockets.serve = serve  # pyright: ignore[reportAttributeAccessIssue]
        try:
            yield taken
        finally:
            sockets.serve = plain


def close_sockets(server: ViserServer) -> None:
    """Close the sockets of all tabs; without a way to do so the server's end closes them."""
    sockets = getattr(server, "_websock_server", None)
    close = getattr(sockets, "disconnect_all_clients", None)
    if close is not None:
        close()


def without_tunnel(server: ViserServer) -> None:
    """Refuse a public address: any client could ask for one, the button is not the only way."""
    server.request_share_url = lambda *_, **__: None  # pyright: ignore[reportAttributeAccessIssue]


_THEIRS = "<title>Viser</title>"


@cache
def _head() -> str:
    style, script = (
        files(__package__ or "").joinpath(name).read_text(encoding="utf-8")
        for name in ("page.css", "page.js")
    )
    return f"<title>softreach</title><style>{style}</style><script>{script}</script>"


@lru_cache(maxsize=4)
def headed(body: bytes, *, zipped: bool) -> bytes:
    """A page with our title, `page.css` and `page.js`; one without viser's title as it is."""
    content = gzip.decompress(body) if zipped else body
    ours = content.replace(_THEIRS.encode(), _head().encode(), 1)
    if ours == content:
        return body
    return gzip.compress(ours) if zipped else ours
