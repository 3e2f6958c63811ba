"""A safe start."""

import re
from http.client import HTTPConnection
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace
from urllib.parse import urlencode

import pytest

import softreach.studio
from softreach.studio import serve
from softreach.support.errors import InvalidInput


@pytest.fixture(scope="module", params=[""])
def server(request):
    """One that asks for a token, or for none."""
    running = serve.start_server(token=request.param)
    yield running
    serve.stop_server(running)


def address_of(server):
    return serve.page_address(server.get_host(), server.get_port())


def test_only_this_machine_can_connect_nobody_opens_a_tunnel_and_a_taken_port_is_refused(server):
    assert server.get_host() == "127.0.0.1"
    assert address_of(server) == f"http://127.0.0.1:{server.get_port()}"
    assert server.request_share_url() is None
    with pytest.raises(InvalidInput, match="a free port"):
        serve.start_server(port=server.get_port())
    with pytest.raises(InvalidInput, match=r"203\.0\.113\.7"):
        serve.start_server(host="203.0.113.7")


@pytest.mark.parametrize("host", ["127.0.0.1:8080", "localhost:8080", "rebound.example:8080"])
def test_pages_from_elsewhere_are_turned_away(host):
    for origin in (f"http://{host}", None):
        headers = {"Host": host} | ({"Origin": origin} if origin else {})
        assert (serve.refusal("127.0.0.1", "", "/", headers) == "") is ("rebound" not in host)
    for origin in ("https://elsewhere.example", "http://127.0.0.1:9999", "null"):
        assert serve.refusal("127.0.0.1", "", "/", {"Host": host, "Origin": origin})


def socket_of(server, **options):
    """A socket to the server, as a page opens it."""
    import viser
    from websockets.sync.client import connect

    address, version = address_of(server).replace("http", "ws"), f"viser-v{viser.__version__}"
    return connect(address, subprotocols=[version], max_size=None, **options)


@pytest.mark.parametrize(
    ("host", "named"),
    [("localhost:80", True), ("[::1]:80", True), ("a b", False), ("x; script-src *", False)],
)
def test_only_a_plain_host_is_named_as_a_place_to_connect_to(host, named):
    rules = serve.page_headers(host)["Content-Security-Policy"].split("; ")
    allowed = "".join(rule for rule in rules if rule.startswith("connect-src"))
    assert (f"ws://{host}" in allowed) is named
    assert not any(rule.startswith("script-src *") for rule in rules)


def test_the_page_is_served_with_rules_and_not_to_be_framed(server):
    page = answer(server, "/", {})
    policy = page.headers["Content-Security-Policy"]
    assert page.status == 200
    assert "frame-ancestors 'none'" in policy
    assert f"ws://127.0.0.1:{server.get_port()}" in policy


def answer(server, path, headers):
    line = HTTPConnection("127.0.0.1", server.get_port(), timeout=600)
    line.request("GET", path, headers=headers)
    found = line.getresponse()
    found.read()
    line.close()
    return found


@pytest.mark.parametrize("server", ["secret"], indirect=True)
def test_without_the_token_there_is_no_page_and_no_socket(server):
    from websockets.exceptions import InvalidStatus

    for token in ("", "token=guess", "token="):
        assert answer(server, f"/?{token}", {}).status == 403
    for cookie in ("softreach_token=guess", "="):
        assert answer(server, "/", {"Cookie": cookie}).status == 403
    with pytest.raises(InvalidStatus, match="403"):
        socket_of(server)
    page = answer(server, "/?token=secret", {})
    cookie = page.headers["Set-Cookie"].split(";")[0]
    assert page.status == answer(server, "/", {"Cookie": f"other=1; {cookie}"}).status == 200
    with socket_of(server, additional_headers={"Cookie": cookie}) as ours:
        assert ours.recv(timeout=600)


def test_others_are_told_addresses_that_they_can_use():
    assert serve.reachable_hosts("127.0.0.1") == []
    assert serve.reachable_hosts("192.0.2.7") == ["192.0.2.7"]
    assert not {"0.0.0.0", "127.0.0.1"} & set(serve.reachable_hosts("0.0.0.0"))
    assert serve.page_address("::", 80) == "http://127.0.0.1:80"
    assert serve.page_address("fe80::1", 80) == "http://[fe80::1]:80"


def test_an_address_that_names_another_server_is_refused():
    headers = {"Host": "127.0.0.1:8080"}
    assert not serve.refusal("127.0.0.1", "", "/", headers)
    own = urlencode({"websocket": "ws://127.0.0.1:8080/?state=x"})
    assert not serve.refusal("127.0.0.1", "", f"/?{own}", headers)
    for foreign in ("ws://elsewhere.example", "wss://127.0.0.1:9999", "", "x", "ws://[", "//"):
        told = serve.refusal("127.0.0.1", "", "/?" + urlencode({"websocket": foreign}), headers)
        assert bool(told) is bool(foreign)


# What of viser is private, and goes when viser offers it


def test_our_head_is_for_this_viser_and_another_page_stays_as_it_is():
    """If this fails, try the page without each part of our head; then move the upper pin."""
    import viser

    assert viser.__version__.startswith("1.1.")
    page = files(viser).joinpath("client/build/index.html").read_bytes()
    assert page.count(b"<title>Viser</title>") == 1
    assert b"<title>softreach</title>" in serve.headed(page, zipped=False)
    other = b"<html><head><title>Another</title></head></html>"
    assert serve.headed(other, zipped=False) == other


@pytest.mark.parametrize(
    ("words", "users"),
    [
        ("import html", {"markup.py"}), (r"add_html\(", {"widgets.py"}), (r"add_markdown\(", set()),
        (r"server\._[a-z]|_live_connections|_websock|sockets\.serve", {"serve.py"}),
    ],
)  # fmt: skip
def test_one_file_only_makes_markup_of_text_or_uses_names_that_viser_keeps_to_itself(words, users):
    sources = Path(softreach.studio.__file__).parent.rglob("*.py")
    assert {p.name for p in sources if re.search(words, p.read_text(encoding="utf-8"))} == users


def test_a_server_whose_requests_cannot_be_checked_does_not_start(monkeypatch):
    import viser.infra._infra as infra
    import websockets.asyncio.server as sockets

    own = SimpleNamespace(**vars(infra.websockets))
    own.asyncio = SimpleNamespace(server=SimpleNamespace(**vars(sockets)))
    monkeypatch.setattr(infra, "websockets", own)
    with pytest.raises(InvalidInput, match="viser"):
        serve.start_server(token="secret")
