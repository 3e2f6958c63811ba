"""Links that hold a state."""

from __future__ import annotations

from urllib.parse import parse_qs, urlsplit

import pytest
from hypothesis import given

from softreach.studio.start import state_in_request, state_link
from softreach.studio.state import StudioState
from softreach.support.errors import InvalidInput
from tests.studio.test_state import states

URL = "http://127.0.0.1:8080"


def asked(link: str) -> str:
    """What the socket that a link tells the page to open asks for."""
    (socket,) = parse_qs(urlsplit(link).query)["websocket"]
    assert socket.startswith("ws://127.0.0.1:8080/")
    return socket.removeprefix("ws://127.0.0.1:8080")


@given(states())
def test_a_state_comes_back_from_its_link(state):
    link = state_link(URL, state)
    assert link.startswith(f"{URL}/?")
    assert state_in_request(asked(link)) == state


def test_a_plain_address_asks_for_no_state():
    assert state_in_request("/") is None
    assert state_in_request("/?other=1") is None


def test_a_broken_link_says_so(trunk):
    path = asked(state_link(URL, StudioState(design=trunk)))
    for broken in (path[:-40], "/?state=abc", "/?state=%C3%A9"):
        with pytest.raises(InvalidInput, match="link"):
            state_in_request(broken)


def test_a_state_too_long_for_an_address_is_refused(trunk, monkeypatch):
    monkeypatch.setattr("softreach.studio.start._LONGEST", 100)
    with pytest.raises(InvalidInput, match="in a link"):
        state_link(URL, StudioState(design=trunk))
