"""A web address that holds the state of a tab."""

from __future__ import annotations

import base64
import zlib
from urllib.parse import parse_qs, quote, urlsplit

from softreach.studio.state import StudioState
from softreach.support.errors import InvalidInput

__all__ = ["state_in_request", "state_link"]

_LONGEST = 7000  # a request line may have 8192 characters
_LARGEST = 1 << 20  # bytes of an unpacked state


def state_link(url: str, state: StudioState) -> str:
    """The address that opens a tab in this state, while the studio serves at that port.

    viser's page hands nothing of its address to the server but the socket that it is told to open,
    so the state travels in the socket's address.

    Raises:
        InvalidInput: The state is too long for an address.
    """
    packed = base64.urlsafe_b64encode(zlib.compress(state.to_json().encode(), 9)).decode()
    socket = url.replace("http", "ws", 1) + "/?state=" + packed.rstrip("=")
    if len(socket) > _LONGEST:
        raise InvalidInput("state", f"{len(socket)} characters", f"{_LONGEST} in a link", "save it")
    return f"{url}/?websocket={quote(socket, safe='')}"


def state_in_request(path: str) -> StudioState | None:
    """The state that the socket of a page asks for, or None.

    Raises:
        InvalidInput: It is no state.
        InvalidDesign: A design in it cannot exist.
    """
    packed = parse_qs(urlsplit(path).query).get("state")
    return StudioState.from_json(_unpacked(packed[0])) if packed else None


def _unpacked(text: str) -> bytes:
    stream = zlib.decompressobj()
    try:
        data = base64.b64decode(text + "=" * (-len(text) % 4), altchars=b"-_", validate=True)
        unpacked = stream.decompress(data, _LARGEST)
    except (ValueError, zlib.error) as error:
        raise InvalidInput("link", str(error), "one that the studio made, complete") from None
    if not stream.eof:
        raise InvalidInput("link", "cut short", "one that the studio made, complete")
    return unpacked
