"""A tab without a browser: a socket that reads what it is sent."""

import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from softreach.studio import Studio
from softreach.studio.session import Session

PATIENCE = 600.0  # [s] on a loaded machine
CAMERA = {
    "type": "ViewerCameraMessage",
    "wxyz": (1.0, 0.0, 0.0, 0.0),
    "position": (2.0, -4.0, 1.0),
    "fov": 0.8,
    "near": 0.1,
    "far": 100.0,
    "image_height": 500,
    "image_width": 800,
    "look_at": (0.0, 0.0, 0.3),
    "up_direction": (0.0, 0.0, 1.0),
}


def until(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@contextmanager
def connected(studio: Studio, cookie: str = "") -> Iterator[Callable[[object], None]]:
    """What a tab is to the server: a socket that reads all it is sent and has told its camera.

    Yields:
        Sends a message, or bytes as they are.
    """
    import msgspec
    import viser
    from websockets.exceptions import ConnectionClosed
    from websockets.sync.client import connect

    address = studio.url.replace("http", "ws", 1)
    version = [f"viser-v{viser.__version__}"]
    options = {"subprotocols": version, "max_size": None}
    with connect(address, **options, additional_headers={"Cookie": cookie}) as socket:

        def read() -> None:
            with suppress(ConnectionClosed):
                for _ in socket:
                    pass

        reader = threading.Thread(target=read, daemon=True)
        reader.start()
        socket.send(msgspec.msgpack.encode(CAMERA))
        yield lambda m: socket.send(m if isinstance(m, bytes) else msgspec.msgpack.encode(m))
    reader.join(PATIENCE)


@contextmanager
def page(studio: Studio, cookie: str = "") -> Iterator[Session]:
    """A tab that shows what it has to."""
    known = set(studio.sessions)
    with connected(studio, cookie):
        until(lambda: set(studio.sessions) - known)
        session = studio.sessions[max(studio.sessions)]
        until(lambda: session.panels and session.found.reach is not None and not session.busy)
        yield session
