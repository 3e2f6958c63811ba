"""Where a server is reached, and which ports it may have."""

from __future__ import annotations

import contextlib
import hmac
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
    """Whether only this machine can connect."""
    return host in _LOCAL or host.startswith("127.")


def check_port(port: int) -> None:
    """Refuse what is no port.

    Raises:
        InvalidInput: It is not from 1 to 65535.
    """
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
    found = [_outward()]
    with contextlib.suppress(OSError):
        found += [str(one[4][0]) for one in socket.getaddrinfo(socket.gethostname(), None)]
    families = (host == "::", False)
    useful = [one for one in found if one and not is_local(one) and (":" in one) in families]
    return list(dict.fromkeys(useful))


def _outward() -> str:
    """The address that this machine would call from; nothing is sent."""
    try:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
            line.connect(("192.0.2.1", 9))  # reserved for examples
            return str(line.getsockname()[0])
    except OSError:
        return ""


# A secret that a page has to know where others can reach the studio.


_NAME = "softreach_token"


def new_token() -> str:
    """A token that nobody guesses."""
    return secrets.token_urlsafe(18)


def with_token(address: str, token: str) -> str:
    """An address that shows the token; the address alone without any."""
    return f"{address}/?token={token}" if token else address


def is_welcome(path: str, headers: Mapping[str, str], token: str) -> bool:
    """Whether a request shows the token: in its address, or in the cookie that it got for that.

    Args:
        path: Of the request, with its query.
        headers: Of the request.
        token: "" where none is asked for.
    """
    if not token:
        return True
    shown = [*parse_qs(urlsplit(path).query).get("token", []), *_kept(headers.get("Cookie", ""))]
    return any(hmac.compare_digest(one.encode(), token.encode()) for one in shown)


def cookie(path: str, token: str) -> str:
    """What the answer to a request sets, so that the page's own requests show the token."""
    if not token or "token" not in parse_qs(urlsplit(path).query):
        return ""
    return f"{_NAME}={token}; Path=/; HttpOnly; SameSite=Lax"


def _kept(text: str) -> list[str]:
    try:
        kept = SimpleCookie(text).get(_NAME)
    except CookieError:
        return []
    return [kept.value] if kept is not None else []
