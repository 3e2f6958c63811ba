"""Fixes of viser: when they can go, and what is left where viser lacks what they need."""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path
from types import SimpleNamespace

import pytest

import softreach.studio
from softreach.studio.serve import viser_fixes
from softreach.studio.serve.server import start_server
from softreach.support.errors import InvalidInput


def test_the_fixes_are_for_this_viser():
    """If this fails, try the page without each part of our head; then move the upper pin."""
    import viser

    assert viser.__version__.startswith("1.1.")
    page = files(viser).joinpath("client/build/index.html").read_text(encoding="utf-8")
    assert page.count("<title>Viser</title>") == 1
    assert "<title>softreach</title>" in viser_fixes.headed(page)


def test_viser_still_has_no_public_way_to_the_sockets_of_its_pages():
    """If this fails, see whether the fixes of sockets and the upper pin of viser can go."""
    import viser

    words = re.compile("client|connect|request|header|origin|socket")
    offered = {name for name in dir(viser.ViserServer) if not name.startswith("_")}
    assert {name for name in offered if words.search(name)} == {
        "disconnect_share_url",
        "get_clients",
        "on_client_connect",
        "on_client_disconnect",
        "request_share_url",
    }
    handle = {name for name in dir(viser.ClientHandle) if not name.startswith("_")}
    assert not {name for name in handle if words.search(name)}


def test_only_one_file_uses_names_that_viser_keeps_to_itself():
    room = Path(softreach.studio.__file__).parent
    private = re.compile(r"server\._[a-z]|_live_connections|_websock|sockets\.serve")
    users = {p.name for p in room.rglob("*.py") if private.search(p.read_text(encoding="utf-8"))}
    assert users == {"viser_fixes.py"}


def test_a_server_whose_requests_cannot_be_checked_does_not_start(monkeypatch):
    import viser.infra._infra as infra
    import websockets.asyncio.server as sockets

    own = SimpleNamespace(**vars(infra.websockets))
    own.asyncio = SimpleNamespace(server=SimpleNamespace(**vars(sockets)))
    monkeypatch.setattr(infra, "websockets", own)
    with pytest.raises(InvalidInput, match="viser"):
        start_server(token="secret")


def test_without_its_private_sockets_tabs_close_with_the_server():
    plain = SimpleNamespace()
    viser_fixes.close_sockets(plain)
    half = SimpleNamespace(_websock_server=SimpleNamespace())
    viser_fixes.close_sockets(half)


def test_a_page_with_another_head_is_left_as_it_is():
    page = "<html><head><title>Another</title></head></html>"
    assert viser_fixes.headed(page) == page
    assert viser_fixes.headed_body(page.encode(), zipped=False) == page.encode()
