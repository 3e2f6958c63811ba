"""A safe start: this machine only, a free port, no tunnel, no pages from elsewhere."""

from __future__ import annotations

import contextlib
import io
import re
import socket
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any
from urllib.parse import urlsplit

from softreach.studio.scene.camera import FOV
from softreach.studio.serve.access import LOOPBACK, check_port, page_address
from softreach.studio.serve.viser_fixes import refuse_unless, sending_headers
from softreach.support.errors import InvalidInput, MissingExtra

if TYPE_CHECKING:
    from viser import GuiApi, ViserServer

__all__ = [
    "LOOPBACK",
    "page_headers",
    "page_url",
    "same_origin",
    "start_server",
    "stop_server",
    "theme",
]

_LOCAL_NAMES = {"localhost", "127.0.0.1", "::1"}


def start_server(host: str = LOOPBACK, port: int | None = None, token: str = "") -> ViserServer:
    """Start serving the page.

    Args:
        host: Address to listen on; everyone who can reach it may use the studio.
        port: None for a free one.
        token: What every page has to know; "" for nothing.

    Raises:
        InvalidInput: The port is none or taken, or the host is not this machine's.
        MissingExtra: viser is not installed.
    """
    try:
        import viser
    except ModuleNotFoundError as error:
        raise MissingExtra("viser", "studio") from error

    check_port(port or 0)
    _check_free(host, port or 0)
    # viser prints a banner; we print our own line.
    with contextlib.redirect_stdout(io.StringIO()), sending_headers(page_headers, token):
        server = viser.ViserServer(host=host, port=port or 0, verbose=False, label="softreach")
    _disable_tunnel(server)
    refuse_unless(server, lambda headers: same_origin(headers, host))
    # Shadows and a mirrored room cost seconds where no graphics card helps, and show nothing.
    server.scene.configure_environment_map(None)
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.add_light_ambient("/light", intensity=1.6)
    theme(server.gui, dark=False)
    server.gui.main_panel.dock_right()
    server.initial_camera.fov = FOV
    return server


def theme(gui: GuiApi, *, dark: bool) -> None:
    """How the page looks around the scene."""
    gui.configure_theme(
        control_width="large", show_logo=False, show_share_button=False, dark_mode=dark
    )


def stop_server(server: ViserServer) -> None:
    """Stop serving, without the line that viser prints."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def page_url(server: ViserServer) -> str:
    """Where the page is, for a browser on this machine."""
    return page_address(server.get_host(), server.get_port())


def same_origin(headers: Mapping[str, str], host: str) -> bool:
    """Whether a connection comes from our own page, or from no page at all.

    Browsers let any web page open a socket to this machine; they tell where it came from. On
    loopback the name must be local too, as foreign names can be made to point here.
    """
    asked = urlsplit(f"//{headers.get('Host', '')}")
    if host in _LOCAL_NAMES and asked.hostname not in _LOCAL_NAMES:
        return False
    origin = headers.get("Origin")
    return origin is None or urlsplit(origin).netloc == asked.netloc


def page_headers(host: str) -> dict[str, str]:
    """What keeps a page to its own server, whatever its address asks for.

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


def _check_free(host: str, port: int) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((host, port))
        except OSError as error:
            allowed = "an address of this machine and a free port"
            raise InvalidInput("host:port", f"{host}:{port}", allowed, str(error)) from None


def _disable_tunnel(server: ViserServer) -> None:
    """Any client could ask for a public address: the button is not the only way."""

    def refuse(*_: Any, **__: Any) -> None:
        return None

    server.request_share_url = refuse
