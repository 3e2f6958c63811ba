"""Studio: a server, and a session for every tab."""

from __future__ import annotations

import threading
import time
from contextlib import AbstractContextManager, suppress
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from softreach.inverse.prepared import forget_prepared
from softreach.kernels.compiler import CompilationWatch
from softreach.plot.style import pyplot
from softreach.studio import serve
from softreach.studio.scene.camera import UPRIGHT, VIEWS
from softreach.studio.session import Session
from softreach.studio.start import KeptWork, Start
from softreach.studio.tabs import JOBS, furnish
from softreach.studio.work import Latest
from softreach.support.errors import SoftreachError

if TYPE_CHECKING:
    from viser import ClientHandle

_LOOK_AT = np.array([0.0, 0.0, 0.28])  # from the base to what a new tab looks at [L]
_GOES_ON = "This goes on where the last work on it ended; Reset leads back to the beginning."
_PATIENCE = 3.0  # [s] for tabs that are closed


class Studio(AbstractContextManager["Studio"]):
    """A local page on a design; every tab has its own state."""

    def __init__(
        self,
        start: Start,
        host: str = serve.LOOPBACK,
        port: int | None = None,
        token: str = "",
        *,
        work: KeptWork | None = None,
    ) -> None:
        """Start serving.

        Args:
            start: What new tabs begin with.
            host: Address to listen on.
            port: None for a free one.
            token: What every page has to know; "" for nothing.
            work: Where the work is kept when tabs and server end; nowhere by default.

        Raises:
            InvalidInput: The address cannot be used.
            MissingExtra: viser is not installed.
        """
        self.start, self._token, self.work = start, token, work
        self.sessions: dict[int, Session] = {}
        self._lock = threading.Lock()
        notice = Latest(lambda _: None)  # a tab that hears of it may be gone
        show = lambda _: [session.show() for session in [*self.sessions.values()]]
        # on another thread: the one that calls holds the compiler's lock
        self._compilation = CompilationWatch(lambda: notice.submit(show))
        self._libraries = threading.Thread(target=load_libraries, daemon=True)
        self._libraries.start()
        self._dark = False  # true if the system of the latest tab is dark
        arrives = lambda dark: setattr(self, "_dark", dark)
        self.server = serve.start_server(host, port, token, arrives)
        arm, camera, eye = start.state.design, start.state.camera, self.server.initial_camera
        look_at = arm.base.to_world(arm.length * _LOOK_AT) / arm.length
        eye.look_at = camera.look_at if camera else look_at
        eye.position = camera.position if camera else look_at + VIEWS["oblique"]
        self.server.on_client_connect(self._connected)
        self.server.on_client_disconnect(self._disconnected)

    @property
    def url(self) -> str:
        """Address of the page, with its token."""
        return serve.page_address(self.server.get_host(), self.server.get_port(), self._token)

    @property
    def urls_for_others(self) -> list[str]:
        """Addresses of the page for other machines; none if it is for this one alone."""
        host, port = self.server.get_host(), self.server.get_port()
        return [serve.page_address(name, port, self._token) for name in serve.reachable_hosts(host)]

    def stop(self) -> None:
        """Stop serving. Tabs go first: viser ends its pool before it reports their closing."""
        self._compilation.close()
        for session in list(self.sessions.values()):
            session.close()
        serve.close_sockets(self.server)
        deadline = time.monotonic() + _PATIENCE
        while self.sessions and time.monotonic() < deadline:
            time.sleep(0.02)
        serve.stop_server(self.server)

    def __exit__(self, *_: object) -> None:
        self.stop()

    def _connected(self, client: ClientHandle) -> None:
        start = self.start
        if self._dark:
            start = replace(start, state=start.state.showing(dark=True))
        session = Session(client, start, JOBS, work=self.work, compilation=self._compilation)
        goes_on = session.is_touched
        with self._lock:
            self.sessions[client.client_id] = session
        with session.lock:  # what a person changes meanwhile waits
            self._show_what_needs_no_library(session)
            self._libraries.join()
            session.begin()
        if self.work is not None and self.work.complaint:
            session.say(self.work.complaint)
        elif goes_on:
            session.say(_GOES_ON)
        if client.client_id not in self.server.get_clients():  # closed before it was furnished
            self._disconnected(client)

    def _show_what_needs_no_library(self, session: Session) -> None:
        furnish(session)
        session.client.camera.on_update(lambda _: session.follow("camera"))
        session.draw_rest()
        if (camera := session.state.camera) is not None:
            session.look_as(camera)
        elif session.camera.aspect < UPRIGHT:
            session.look_from("oblique")

    def _disconnected(self, client: ClientHandle) -> None:
        with self._lock:
            session = self.sessions.pop(client.client_id, None)
        if session is not None:
            session.close()
            if not self.sessions:
                forget_prepared()
            session.keep()


def load_libraries() -> None:
    """Load what several jobs of a tab use: two threads that import it at once see half of it."""
    import xarray  # noqa: F401

    with suppress(SoftreachError):  # whoever draws a figure says so
        pyplot()
