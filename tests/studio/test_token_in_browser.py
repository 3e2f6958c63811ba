"""A studio that others can reach shows itself only to those who know its token."""

from __future__ import annotations

import pytest

from softreach.arm import designs
from softreach.studio import Start, Studio, StudioState
from tests.studio.conftest import SMALL
from tests.studio.tab import Tab


@pytest.fixture
def guarded():
    state = StudioState(design=designs.minimal_trunk()).showing(level=12)
    with Studio(Start(state=state, quality=SMALL), token="secret") as running:
        yield running


@pytest.mark.large
def test_the_address_with_the_token_opens_the_page_and_its_socket(browser, guarded):
    tab = Tab(browser, guarded)
    assert tab.session.reach is not None
    assert tab.errors == []
    tab.close()
