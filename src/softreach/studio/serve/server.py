"""Server of the page, safely started: this machine only, a free port, no pages from elsewhere."""

from __future__ import annotations

import contextlib
import io
import socket
from typing import TYPE_CHECKING

from softreach.studio.scene.camera import FOV
from softreach.studio.serve.guard import LOCAL, guarding, without_tunnel
from softreach.support.errors import InvalidInput, MissingExtra

if TYPE_CHECKING:
    from viser import GuiApi, ViserServer

LOOPBACK = "127.0.0.1"
ANYWHERE = ("0.0.0.0", "::")
_LAST_PORT = 65535


def start_server(host: str = LOOPBACK, port: int | None = None, token: str = "") -> ViserServer:
    """Start serving the page.

    Args:
        host: Address to listen on; everyone who can reach it may use the studio.
        port: None for a free one.
        token: What every page has to know; "" for nothing.

    Raises:
        InvalidInput: The port is none or taken, the host is none or not this machine's, or viser
            is a version whose requests cannot be checked.
        MissingExtra: viser is not installed.
    """
    try:
        import viser
    except ModuleNotFoundError as error:
        raise MissingExtra(("viser", "studio")) from error

    check_address(host, port or 0)
    _check_free(host, port or 0)
    # viser prints a banner; we print our own line.
    with (
        contextlib.redirect_stdout(io.StringIO()),
        guarding(host, token) as guard,
    ):
        server = viser.ViserServer(host=host, port=port or 0, verbose=False, label="softreach")
    if not guard.is_set():
        stop_server(server)
        allowed = "one whose requests can be checked"
        raise InvalidInput("viser", viser.__version__, allowed, "install viser>=1.1,<1.2")
    without_tunnel(server)
    # Shadows and a mirrored room cost seconds where no graphics card helps, and show nothing.
    server.scene.configure_environment_map(None)
    server.scene.configure_default_lights(cast_shadow=False)
    server.scene.add_light_ambient("/light", intensity=1.6)
    theme(server.gui, dark=False)
    server.gui.main_panel.dock_right()
    server.initial_camera.fov = FOV
    return server


def theme(gui: GuiApi, *, dark: bool) -> None:
    """Set the looks of the page around the scene."""
    gui.configure_theme(
        control_width="large", show_logo=False, show_share_button=False, dark_mode=dark
    )


def stop_server(server: ViserServer) -> None:
    """Stop serving, without the line that viser prints."""
    with contextlib.redirect_stdout(io.StringIO()):
        server.stop()


def page_url(server: ViserServer) -> str:
    """Address of the page, for a browser on this machine."""
    return page_address(server.get_host(), server.get_port())


def _check_free(host: str, port: int) -> None:
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    with socket.socket(family) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((host, port))
        except OSError as error:
            allowed = "an address of this machine and a free port"
            raise InvalidInput("host:port", f"{host}:{port}", allowed, str(error)) from None


# Addresses of the server.


def is_local(host: str) -> bool:
    """True if only this machine can connect."""
    return host in LOCAL or host.startswith("127.")


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


def with_token(address: str, token: str) -> str:
    """An address that shows the token; the address alone without any."""
    return f"{address}/?token={token}" if token else address
