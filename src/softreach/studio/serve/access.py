"""Access to the server: its addresses, its token, and the requests that it answers."""

from __future__ import annotations

import contextlib
import hmac
import re
import secrets
import socket
from collections.abc import Mapping
from http.cookies import CookieError, SimpleCookie
from urllib.parse import parse_qs, urlsplit

from softreach.support.errors import InvalidInput

LOOPBACK = "127.0.0.1"
ANYWHERE = ("0.0.0.0", "::")
_LOCAL = ("localhost", LOOPBACK, "::1")
_LAST_PORT = 65535


def is_local(host: str) -> bool:
    """True if only this machine can connect."""
    return host in _LOCAL or host.startswith("127.")


def check_address(host: str, port: int) -> None:
    """Refuse what is no host or no port.

    Raises:
        InvalidInput: No host is named, or the port is not from 1 to 65535 (0 for a free one).
    """
    if not host.strip():  # systems take it for every address of the machine
        allowed = f"an address to listen on, such as {LOOPBACK}"
        raise InvalidInput("host", repr(host), allowed, f"{ANYWHERE[0]} is for every address")
    if not 0 <= port <= _LAST_PORT:
        raise InvalidInput("port", port, f"1 to {_LAST_PORT}", "leave it out for a free one")


def page_address(host: str, port: int) -> str:
    """The address of the page on a host of this machine."""
    shown = LOOPBACK if host in ANYWHERE else host
    return f"http://{f'[{shown}]' if ':' in shown else shown}:{port}"


def reachable_hosts(host: str) -> list[str]:
    """Addresses by which others reach a server that listens on a host; none if it is local."""
    if is_local(host):
        return []
    if host not in ANYWHERE:
        return [host]
    hosts = [_outward()]
    with contextlib.suppress(OSError):
        hosts += [str(address[4][0]) for address in socket.getaddrinfo(socket.gethostname(), None)]
    families = (host == "::", False)
    useful = [
        address
        for address in hosts
        if address and not is_local(address) and (":" in address) in families
    ]
    return list(dict.fromkeys(useful))


def _outward() -> str:
    """The address that this machine would call from; nothing is sent."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.connect(("192.0.2.1", 9))  # reserved for examples
            return str(line.getsockname()[0])
    except OSError:
        return ""


# Token: a secret that a page has to know where others can reach the studio.


_NAME = "softreach_token"
_NO_TOKEN = "The address lacks the token that softreach printed with it.\n"
_FOREIGN = "This page is for its own server alone.\n"
_ELSEWHERE = "This address names another server, to which the page may not connect.\n"


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(18)


def with_token(address: str, token: str) -> str:
    """An address that shows the token; the address alone without any."""
    return f"{address}/?token={token}" if token else address


def is_welcome(path: str, headers: Mapping[str, str], token: str) -> bool:
    """True if a request shows the token: in its address, or in the cookie that it got for that.

    Args:
        path: Of the request, with its query.
        headers: Of the request.
        token: "" where none is needed.
    """
    if not token:
        return True
    shown = [*parse_qs(urlsplit(path).query).get("token", []), *_kept(headers.get("Cookie", ""))]
    return any(hmac.compare_digest(candidate.encode(), token.encode()) for candidate in shown)


def cookie(path: str, token: str) -> str:
    """Cookie that the answer to a request sets, so that the page's own requests show the token."""
    if not token or "token" not in parse_qs(urlsplit(path).query):
        return ""
    return f"{_NAME}={token}; Path=/; HttpOnly; SameSite=Lax"


def _kept(text: str) -> list[str]:
    try:
        kept = SimpleCookie(text).get(_NAME)
    except CookieError:
        return []
    return [kept.value] if kept is not None else []


# Requests: whose are answered, and with which headers.


def refusal(host: str, token: str, path: str, headers: Mapping[str, str]) -> str:
    """Reason why a request is refused; "" for one that is welcome.

    Args:
        host: That the server listens on.
        token: "" where none is needed.
        path: Of the request, with its query.
        headers: Of the request.
    """
    if not is_welcome(path, headers, token):
        return _NO_TOKEN
    if not same_origin(headers, host):
        return _FOREIGN
    sockets = parse_qs(urlsplit(path).query).get("websocket", [])
    own = headers.get("Host", "")
    return "" if all(_place(socket) == own for socket in sockets) else _ELSEWHERE


def _place(address: str) -> str:
    """Name and port in an address; "" if it is none."""
    try:
        return urlsplit(address).netloc
    except ValueError:
        return ""


def answer_headers(token: str, path: str, headers: Mapping[str, str]) -> dict[str, str]:
    """Headers of the answer to a request."""
    kept = cookie(path, token)
    return page_headers(headers.get("Host", "")) | ({"Set-Cookie": kept} if kept else {})


def same_origin(headers: Mapping[str, str], host: str) -> bool:
    """True if a connection comes from our own page, or from no page at all.

    Browsers let any web page open a socket to this machine; they tell where it came from. On
    loopback the name must be local too, as foreign names can be made to point here.
    """
    page = urlsplit(f"//{headers.get('Host', '')}")
    if host in _LOCAL and page.hostname not in _LOCAL:
        return False
    origin = headers.get("Origin")
    return origin is None or urlsplit(origin).netloc == page.netloc


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
    policy = "; ".join(f"{name} {value}" for name, value in rules.items())
    return {
        "Content-Security-Policy": policy,
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
