"""The sockets behind the tabs: the one place that uses names which viser keeps to itself.

viser offers no public way to see the request of a socket, to refuse it, to close all of them, or to
send headers with its page.
The upper pin of viser in `pyproject.toml` is there for this file; a test tells when it can go.
"""

from __future__ import annotations

import gzip
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import lru_cache
from http import HTTPStatus
from typing import TYPE_CHECKING, Any

from softreach.studio.serve.access import cookie, is_welcome

if TYPE_CHECKING:
    from viser import ViserServer


# Our title, rules for small windows and dark ones, when fields apply: the head of viser's page.


_THEIRS = "<title>Viser</title>"
# viser's sheet for phones leaves a third of the width unused, and tabs break into two lines.
# Eleven tabs just fit; where they do not, the line can be moved.
_OURS = """<title>softreach</title><style>
[role="tablist"]:has([role="tab"]){flex-wrap:nowrap!important;overflow-x:auto;scrollbar-width:none}
[role="tab"]{padding-inline:0.15em!important;font-size:0.73rem!important;flex:1 0 auto!important}
[role="tab"]:only-of-type{flex:none!important}
input{text-overflow:ellipsis}
@media (max-width:36em){
div[style*="position: fixed"][style*="max-height: 60%"]{
width:100%!important;max-height:50%!important}
div[style*="position: fixed"][style*="max-height: 60%"] div[style*="width: 20em"]{
width:100%!important}
div[style*="position: fixed"][style*="max-height: 60%"] .mantine-ScrollArea-content{
display:block!important;width:100%!important;min-width:0!important}
div[style*="position: fixed"][style*="max-height: 60%"] div[style*="grid-template-rows"]{
grid-template-columns:minmax(0,1fr)}
}</style>"""
# viser drops what a field tells if Enter follows at once; and fields that are left apply too.
_KEYS = """<script>(function(){
function apply(form){form.typed=false;setTimeout(function(){
if(form.isConnected)form.requestSubmit()},120)}
addEventListener("input",function(e){if(e.target.form)e.target.form.typed=true},true);
addEventListener("keydown",function(e){var form=e.target.form;
if(form&&e.key==="Enter"){e.preventDefault();e.stopPropagation();apply(form)}},true);
addEventListener("focusout",function(e){var form=e.target.form;
if(form&&form.typed)apply(form)},true)})()</script>"""
# viser writes black on white whatever the page looks like; its two shaders for that get a switch.
_LABELS = """<script>(function(){
var gl=window.WebGL2RenderingContext&&WebGL2RenderingContext.prototype;if(!gl)return;
var source=gl.shaderSource,attach=gl.attachShader,use=gl.useProgram;
var shaders=new WeakSet(),programs=new WeakMap();
gl.shaderSource=function(shader,text){
var ours=text.replace("vec4(1.0, 1.0, 1.0, 0.85 * vAlpha)",
"vec4(vec3(1.0 - 0.92 * isDark), 0.85 * vAlpha)").replace("vec4(0.0, 0.0, 0.0, a)",
"vec4(vec3(0.85 * isDark), a)");
if(ours!==text){shaders.add(shader);
ours=ours.replace("void main","uniform float isDark; void main")}
source.call(this,shader,ours)};
gl.attachShader=function(program,shader){
if(shaders.has(shader))programs.set(program,null);attach.call(this,program,shader)};
gl.useProgram=function(program){use.call(this,program);
if(!program||!programs.has(program))return;
var place=programs.get(program)||this.getUniformLocation(program,"isDark");
programs.set(program,place);
this.uniform1f(place,document.documentElement.dataset.mantineColorScheme==="dark"?1:0)}})()</script>"""
_HEAD = _OURS + _KEYS + _LABELS


def headed(page: str) -> str:
    """A page with our head."""
    return page.replace(_THEIRS, _HEAD, 1)


@lru_cache(maxsize=4)
def headed_body(body: bytes, *, zipped: bool) -> bytes:
    """The same for what is sent of a page; anything else as it is."""
    content = gzip.decompress(body) if zipped else body
    ours = content.replace(_THEIRS.encode(), _HEAD.encode(), 1)
    if ours == content:
        return body
    return gzip.compress(ours) if zipped else ours


_FORBIDDEN = "The address lacks the token that softreach printed with it.\n"
_starting = threading.Lock()


def asked_path(server: ViserServer, client_id: int) -> str:
    """The address that the socket of a page asked for, from the first slash on."""
    live = server._websock_server._live_connections.get(client_id)
    request = live.request if live is not None else None
    return "/" if request is None else request.path


def close_all(server: ViserServer) -> None:
    """Close the sockets of all tabs."""
    server._websock_server.disconnect_all_clients()


def refuse_unless(server: ViserServer, welcome: Callable[[Any], bool]) -> None:
    """Close every socket whose headers are not welcome before anything is sent to it."""
    sockets = server._websock_server

    @sockets.on_client_connect
    async def _(client: Any) -> None:
        live = sockets._live_connections[client.client_id]
        request = live.request
        if request is None or not welcome(request.headers):
            await live.close(1008, "not our page")


@contextmanager
def sending_headers(headers: Callable[[str], Mapping[str, str]], token: str = "") -> Iterator[None]:
    """A server that starts inside the block sends these headers with everything, and our title.

    Args:
        headers: From the host that was asked for, as the request names it.
        token: What requests have to show, pages and sockets alike; all others get 403.
    """
    import websockets.asyncio.server as sockets

    plain = sockets.serve

    def add(connection: Any, request: Any, response: Any) -> None:
        del connection
        for name, value in headers(request.headers.get("Host", "")).items():
            response.headers[name] = value
        if kept := cookie(request.path, token):
            response.headers["Set-Cookie"] = kept
        if response.headers.get("Content-Type", "").startswith("text/html"):
            zipped = response.headers.get("Content-Encoding") == "gzip"
            response.body = headed_body(response.body, zipped=zipped)
            del response.headers["Content-Length"]
            response.headers["Content-Length"] = str(len(response.body))

    def serve(*arguments: Any, process_request: Any = None, **options: Any) -> Any:
        def admit(connection: Any, request: Any) -> Any:
            if not is_welcome(request.path, request.headers, token):
                return connection.respond(HTTPStatus.FORBIDDEN, _FORBIDDEN)
            return process_request(connection, request) if process_request else None

        return plain(*arguments, process_request=admit, process_response=add, **options)

    with _starting:
        sockets.serve = serve  # pyright: ignore[reportAttributeAccessIssue]
        try:
            yield
        finally:
            sockets.serve = plain
