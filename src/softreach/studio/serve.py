"""Server of the page: this machine only, a free port, and every request checked.

viser offers no public way to see a request, to refuse it, or to send headers with its page, so this
file uses names that viser keeps to itself. A second server in front of viser's would leave viser's
own port open to every page and program of this machine.
"""

from __future__ import annotations

import gzip
import hmac
import io
import re
import socket
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, redirect_stdout, suppress
from functools import lru_cache
from http import HTTPStatus
from http.cookies import CookieError, SimpleCookie
from importlib.resources import files
from typing import TYPE_CHECKING, Any
from urllib.parse import parse_qs, urlsplit

from softreach.studio.scene.camera import FOV
from softreach.support.errors import InvalidInput, check_installed

if TYPE_CHECKING:
    from viser import GuiApi, ViserServer

Arrives = Callable[[bool], object]  # hears of a tab, and whether its system is dark
LOOPBACK, LOCAL = "127.0.0.1", ("localhost", "127.0.0.1", "::1")
ANYWHERE = ("0.0.0.0", "::")
_LAST_PORT = 65535
_COOKIE, _DARK = "softreach_token", "softreach_dark"
_NO_TOKEN = "The address lacks the token that softreach printed with it.\n"
_FOREIGN = "This page is for its own server alone.\n"
_ELSEWHERE = "This address names another server, to which the page may not connect.\n"
_SOCKET = re.compile(r"wss?://([^/?#]*)")
_PLAIN_HOST = re.compile(r"[A-Za-z0-9.\-]+(:\d+)?|\[[0-9A-Fa-f:.]+\](:\d+)?")
_CLOSED = "media-src", "frame-src", "object-src", "base-uri", "form-action", "frame-ancestors"
_POLICY = {
    "default-src": "'self'",
    "script-src": "'self' 'unsafe-inline' 'unsafe-eval' blob:",
    "script-src-attr": "'none'",
    "style-src": "'self' 'unsafe-inline'",
    "img-src": "'self' data: blob:",
    "font-src": "'self' data:",
    "worker-src": "'self' blob: data:",
    **dict.fromkeys(_CLOSED, "'none'"),
}


def start_server(
    host: str = LOOPBACK,
    port: int | None = None,
    token: str = "",
    arrives: Arrives = lambda dark: None,
) -> ViserServer:
    """Start serving the page; no port is for a free one, no token for pages that know none."""
    check_installed("viser")
    import viser

    _check_address(host, port or 0)
    # viser prints a banner; we print our own line.
    with redirect_stdout(io.StringIO()), guarding(host, token, arrives) as guards:
        server = viser.ViserServer(host=host, port=port or 0, verbose=False, label="softreach")
    if not guards:
        stop_server(server)
        allowed = "one whose requests can be checked"
        raise InvalidInput("viser", viser.__version__, allowed, "install viser>=1.1,<1.2")
    # Any client could ask for a public address: the button is not the only way.
    server.request_share_url = lambda *_, **__: None  # pyright: ignore[reportAttributeAccessIssue]
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
    with redirect_stdout(io.StringIO()):
        server.stop()


# Requests that are answered, and headers of the answers.


def refusal(host: str, token: str, path: str, headers: Mapping[str, str]) -> str:
    """Reason why a server that listens on a host refuses a request; "" for one that is welcome.

    Browsers let any web page open a socket to this machine; they say where it came from. On
    loopback the name must be local too, as foreign names can be made to point here.
    """
    query = parse_qs(urlsplit(path).query)
    shown = [*query.get("token", []), *_cookie(headers, _COOKIE)]
    if token and not any(hmac.compare_digest(each.encode(), token.encode()) for each in shown):
        return _NO_TOKEN
    own, origin = headers.get("Host", ""), headers.get("Origin")
    page = urlsplit(f"//{own}")
    is_rebound = host in LOCAL and page.hostname not in LOCAL
    if is_rebound or (origin is not None and urlsplit(origin).netloc != page.netloc):
        return _FOREIGN
    sockets = [_SOCKET.match(each) for each in query.get("websocket", [])]
    return "" if all(each and each[1] == own for each in sockets) else _ELSEWHERE


def _cookie(headers: Mapping[str, str], name: str) -> list[str]:
    cookies = SimpleCookie()
    with suppress(CookieError):
        cookies.load(headers.get("Cookie", ""))
    return [cookies[name].value] if name in cookies else []


def page_headers(host: str) -> dict[str, str]:
    """Headers that keep a page to its own server, by name and port as its request has them."""
    # viser's page is one file of inline scripts, and would open any socket that its address names
    plain = _PLAIN_HOST.fullmatch(host) is not None
    sockets = f" ws://{host} wss://{host}" if plain else ""  # older browsers: not part of 'self'
    rules = _POLICY | {"connect-src": f"'self' data: blob:{sockets}"}
    return {
        "Content-Security-Policy": "; ".join(f"{name} {value}" for name, value in rules.items()),
        "X-Frame-Options": "DENY",
        "X-Content-Type-Options": "nosniff",
        "Referrer-Policy": "no-referrer",
    }


@contextmanager
def guarding(host: str, token: str, arrives: Arrives) -> Iterator[list[Any]]:
    """Servers that start in the block check each request; yields those that do."""
    import websockets.asyncio.server as sockets

    plain, guarded = sockets.serve, list[Any]()

    def add(connection: Any, request: Any, response: Any) -> None:
        for name, value in page_headers(request.headers.get("Host", "")).items():
            response.headers[name] = value
        if token and "token" in parse_qs(urlsplit(request.path).query):
            cookie = f"{_COOKIE}={token}; Path=/; HttpOnly; SameSite=Lax"
            response.headers["Set-Cookie"] = cookie
        if response.headers.get("Content-Type", "").startswith("text/html"):
            zipped = response.headers.get("Content-Encoding") == "gzip"
            response.body = headed(response.body, zipped=zipped)
            del response.headers["Content-Length"]
            response.headers["Content-Length"] = str(len(response.body))

    def serve(*arguments: Any, process_request: Any = None, **options: Any) -> Any:
        def admit(connection: Any, request: Any) -> Any:
            if reason := refusal(host, token, request.path, request.headers):
                return connection.respond(HTTPStatus.FORBIDDEN, reason)
            if "Upgrade" in request.headers:
                arrives("1" in _cookie(request.headers, _DARK))
            return process_request(connection, request) if process_request else None

        guarded.append(plain(*arguments, process_request=admit, process_response=add, **options))
        return guarded[-1]

    sockets.serve = serve  # pyright: ignore[reportAttributeAccessIssue]
    try:
        yield guarded
    finally:
        sockets.serve = plain


def close_sockets(server: ViserServer) -> None:
    """Close the sockets of all tabs; without a way to do so the server's end closes them."""
    sockets = getattr(server, "_websock_server", None)
    getattr(sockets, "disconnect_all_clients", lambda: None)()


@lru_cache(maxsize=4)
def headed(body: bytes, *, zipped: bool) -> bytes:
    """A page with our title, `page.css` and `page.js`; one without viser's title as it is."""
    content = gzip.decompress(body) if zipped else body
    place = files("softreach.studio")
    style, script = (place.joinpath(name).read_bytes() for name in ("page.css", "page.js"))
    title = b"<title>softreach</title>"
    head = b"%b<style>%b</style><script>%b</script>" % (title, style, script)
    ours = content.replace(b"<title>Viser</title>", head, 1)
    if ours == content:
        return body
    return gzip.compress(ours) if zipped else ours


# Addresses of the server.


def _check_address(host: str, port: int) -> None:
    if not host.strip():  # systems take it for every address of the machine
        allowed = f"an address to listen on, such as {LOOPBACK}"
        raise InvalidInput("host", repr(host), allowed, f"{ANYWHERE[0]} is for every address")
    if not 0 <= port <= _LAST_PORT:
        raise InvalidInput("port", port, f"1 to {_LAST_PORT}", "leave it out for a free one")
    with socket.socket(socket.AF_INET6 if ":" in host else socket.AF_INET) as trial:
        trial.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            trial.bind((host, port))
        except OSError as error:
            allowed = "an address of this machine and a free port"
            raise InvalidInput("host:port", f"{host}:{port}", allowed, str(error)) from None


def is_local(host: str) -> bool:
    """True if only this machine can connect."""
    return host in LOCAL or host.startswith("127.")


def page_address(host: str, port: int, token: str = "") -> str:
    """The address of the page on a host of this machine; it shows the token, if there is one."""
    shown = LOOPBACK if host in ANYWHERE else host
    address = f"http://{f'[{shown}]' if ':' in shown else shown}:{port}"
    return f"{address}/?token={token}" if token else address


def reachable_hosts(host: str) -> list[str]:
    """Addresses by which others reach a server that listens on a host; none if it is local."""
    if host not in ANYWHERE:
        return [] if is_local(host) else [host]
    with suppress(OSError), socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as line:
        # the one that this machine would call others from
        line.connect(("192.0.2.1", 9))  # reserved for examples; nothing is sent
        return [str(line.getsockname()[0])]
    return []
