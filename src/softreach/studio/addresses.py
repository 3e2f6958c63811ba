"""Where a server is reached, and which ports it may have."""

from __future__ import annotations

import contextlib
import socket

from softreach.support.errors import InvalidInput

__all__ = ["ANYWHERE", "LOOPBACK", "check_port", "is_local", "page_address", "reachable_hosts"]

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
