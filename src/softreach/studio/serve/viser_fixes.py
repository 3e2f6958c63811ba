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
from functools import cache, lru_cache, partial
from http import HTTPStatus
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from softreach.studio.serve.messages import LARGEST_UPLOAD, is_choice, is_message

if TYPE_CHECKING:
    from viser import ClientHandle, ViserServer

__all__ = [
    "close_sockets",
    "guard_inputs",
    "guarding",
    "headed",
    "headed_body",
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
        handler, *others = arguments
        return plain(
            _deaf(handler), *others, process_request=admit, process_response=add, **options
        )

    if plain is None:
        yield taken
        return
    with _starting:
        sockets.serve = serve  # pyright: ignore[reportAttributeAccessIssue]
        try:
            yield taken
        finally:
            sockets.serve = plain


def _deaf(handler: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A handler of sockets that hears only what viser can read: what it cannot ends a socket."""

    async def handle(connection: Any) -> None:
        receive = connection.recv

        async def receive_message(*arguments: Any, **options: Any) -> Any:
            while not is_message(raw := await receive(*arguments, **options)):
                pass
            return raw

        connection.recv = receive_message
        await handler(connection)

    return handle


def guard_inputs(client: ClientHandle, refuse: Callable[[str, int], None]) -> None:
    """Let widgets take only values that they can hold, and files that are not too large.

    viser sets whatever a socket says, and holds a file whole before it tells of it.

    Args:
        client: The tab.
        refuse: Told name and bytes of a file that is too large.
    """
    from viser import _messages

    gui: Any = client.gui
    inputs = _Inputs(gui, refuse)
    for kind, handler, ours in (
        (_messages.GuiUpdateMessage, "_handle_gui_updates", inputs.change),
        (_messages.FileTransferStartUpload, "_handle_file_transfer_start", inputs.begin_file),
        (_messages.FileTransferPart, "_handle_file_transfer_part", inputs.take_part),
    ):
        theirs, line = getattr(gui, handler, None), getattr(gui, "_websock_interface", None)
        if theirs is not None and line is not None:
            line.unregister_handler(kind, theirs)
            line.register_handler(kind, partial(ours, theirs))


class _Inputs:
    def __init__(self, gui: Any, refuse: Callable[[str, int], None]) -> None:
        self._gui, self._refuse = gui, refuse
        self._taken: dict[str, int] = {}
        """Bytes of the files that are on their way."""

    async def change(self, accept: Any, number: int, message: Any) -> None:
        handle = self._gui._gui_input_handle_from_uuid.get(message.uuid)
        if handle is None or set(message.updates) != {"value"}:
            return
        options = getattr(handle, "options", None)
        if is_choice(message.updates["value"], handle.value, options):
            await accept(number, message)

    def begin_file(self, accept: Any, number: int, message: Any) -> None:
        from viser import _messages

        if message.size_bytes <= LARGEST_UPLOAD:
            self._taken[message.transfer_uuid] = 0
            accept(number, message)
            return
        end = _messages.FileTransferPartAck(
            source_component_uuid=message.source_component_uuid,
            transfer_uuid=message.transfer_uuid,
            transferred_bytes=message.size_bytes,
            total_bytes=message.size_bytes,
        )
        self._gui._websock_interface.queue_message(end)  # or the page shows it as under way
        self._refuse(message.filename, message.size_bytes)

    def take_part(self, accept: Any, number: int, message: Any) -> None:
        """A part of a file is there; no more is held than was allowed."""
        size = self._taken.get(message.transfer_uuid, LARGEST_UPLOAD) + len(message.content)
        if size <= LARGEST_UPLOAD:
            self._taken[message.transfer_uuid] = size
            accept(number, message)


def close_sockets(server: ViserServer) -> None:
    """Close the sockets of all tabs; without a way to do so the server's end closes them."""
    sockets = getattr(server, "_websock_server", None)
    close = getattr(sockets, "disconnect_all_clients", None)
    if close is not None:
        close()


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
