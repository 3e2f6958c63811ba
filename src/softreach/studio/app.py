"""The studio: a server, and a session for every tab."""

from __future__ import annotations

import threading
import time
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from softreach.studio.compiling import CompilationWatch
from softreach.studio.connections import asked_path, close_all
from softreach.studio.link import state_in_request
from softreach.studio.panels.binding import attempt
from softreach.studio.server import LOOPBACK, page_url, start_server, stop_server
from softreach.studio.session import Session
from softreach.studio.source import Start
from softreach.studio.state import Camera
from softreach.studio.worker import Latest

if TYPE_CHECKING:
    from viser import ClientHandle

__all__ = ["Studio"]

_EYE = Camera(position=(2.1, -3.85, 1.45), look_at=(0.0, 0.0, 0.28))
_EYE_ON_MAP = Camera(position=(1.9, -6.3, 2.0), look_at=(-0.95, -0.5, 0.3))


class Studio:
    """A local page on a design; every tab has its own state."""

    def __init__(self, start: Start, host: str = LOOPBACK, port: int | None = None) -> None:
        """Start serving.

        Args:
            start: What new tabs begin with.
            host: Address to listen on.
            port: None for a free one.

        Raises:
            InvalidInput: The address cannot be used.
            MissingExtra: viser is not installed.
        """
        self.start = start
        self.sessions: dict[int, Session] = {}
        self._lock = threading.Lock()
        self._notice = Latest(_ignored)
        self._compilation = CompilationWatch(self._compiling)
        self.server = start_server(host, port)
        camera = start.state.camera or (_EYE if start.atlas is None else _EYE_ON_MAP)
        self.server.initial_camera.position = camera.position
        self.server.initial_camera.look_at = camera.look_at
        self.server.on_client_connect(self._connected)
        self.server.on_client_disconnect(self._disconnected)

    @property
    def url(self) -> str:
        """Where the page is."""
        return page_url(self.server)

    def stop(self) -> None:
        """Stop serving."""
        self._compilation.close()
        for session in list(self.sessions.values()):
            session.close()
        self._disconnect_tabs()
        stop_server(self.server)

    def _disconnect_tabs(self, patience: float = 3.0) -> None:
        """Close the tabs' connections first: viser ends its pool before it reports the closing."""
        close_all(self.server)
        deadline = time.monotonic() + patience
        while self.sessions and time.monotonic() < deadline:
            time.sleep(0.02)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    def _compiling(self, running: bool) -> None:
        """Tell every tab, on another thread: this one holds the compiler's lock."""
        self._notice.submit(lambda _: self._tell(running))

    def _tell(self, running: bool) -> None:
        for session in list(self.sessions.values()):
            session.compiling = running
            session.show()

    def _connected(self, client: ClientHandle) -> None:
        session = Session(client, self.start)
        session.compiling = self._compilation.running
        with self._lock:
            self.sessions[client.client_id] = session
        _furnish(session, self.url)
        session.begin()
        if session.atlas is not None and session.board is None:
            session.say("There is no map: the atlas is no grid of two parameters or more.")
        attempt(session, lambda: self._follow_link(session))

    def _follow_link(self, session: Session) -> None:
        """Bring a tab that was opened by a link into its state."""
        state = state_in_request(asked_path(self.server, session.client.client_id))
        if state is not None:
            session.restore(state)

    def _disconnected(self, client: ClientHandle) -> None:
        with self._lock:
            session = self.sessions.pop(client.client_id, None)
        if session is not None:
            session.close()


def _ignored(error: Exception) -> None:
    """A tab that is told may be gone."""
    del error


def _furnish(session: Session, url: str) -> None:
    """Add the panels, and let clicks in the scene reach those that wait for them."""
    from softreach.studio.panels.activation import ActivationPanel
    from softreach.studio.panels.atlas import AtlasPanel
    from softreach.studio.panels.design import DesignPanel
    from softreach.studio.panels.export import ExportPanel
    from softreach.studio.panels.inverse import InversePanel
    from softreach.studio.panels.loads import LoadsPanel
    from softreach.studio.panels.parts import PartsPanel
    from softreach.studio.panels.path import PathPanel
    from softreach.studio.panels.plots import PlotsPanel
    from softreach.studio.panels.status import StatusPanel
    from softreach.studio.panels.view import ViewPanel

    gui = session.client.gui
    made: list[Any] = [StatusPanel(gui, session)]
    tabs = gui.add_tab_group()
    kinds = {
        "Design": DesignPanel,
        "Parts": PartsPanel,
        "Loads": LoadsPanel,
        "Activation": ActivationPanel,
        "Inverse": InversePanel,
        "Path": PathPanel,
        "View": ViewPanel,
        "Plots": PlotsPanel,
    }
    made += [kind(gui, tabs.add_tab(name), session) for name, kind in kinds.items()]
    made.append(ExportPanel(gui, tabs.add_tab("Export"), session, url))
    if session.board is not None:
        made.append(AtlasPanel(gui, tabs.add_tab("Atlas"), session, session.board))
    session.panels = made
    clickable = AtlasPanel | PathPanel | InversePanel
    waiting = [panel for panel in reversed(made) if isinstance(panel, clickable)]

    @session.client.scene.on_click()
    def _(event: Any) -> None:
        any(panel.click(event.ray_origin, event.ray_direction) for panel in waiting)
