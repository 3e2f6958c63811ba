"""A studio with small clouds, and a headless Chromium that looks at it."""

from collections.abc import Iterator

import pytest

from softreach.arm import designs
from softreach.studio import Quality, Start, Studio, StudioState
from softreach.studio.session import Session
from tests.studio import sockets
from tests.studio.tab import Tab

SMALL = Quality(coarse_level=11, fine_level=12, coarse_accuracy=0.05, fine_accuracy=0.02)


@pytest.fixture(scope="session")
def studio() -> Iterator[Studio]:
    look = {"level": 12, "cloud": True, "surface": False}
    start = Start(state=StudioState(design=designs.minimal_trunk()).showing(**look), quality=SMALL)
    with Studio(start) as running:
        yield running


@pytest.fixture(scope="module")
def opened(studio) -> Iterator[Session]:
    """A tab without a browser, which the tests of a file share."""
    with sockets.page(studio) as session:
        yield session


@pytest.fixture(scope="session")
def page(browser, studio) -> Iterator[Tab]:
    """The tab of all journeys: opening one takes seconds."""
    opened = Tab(browser, studio)
    assert opened.errors == []  # such as of a rule that the page sets itself and breaks
    yield opened
    opened.close()


@pytest.fixture
def tab(page, studio) -> Iterator[Tab]:
    """That tab as it was opened; whatever a test does in it, its console stays clean."""
    page.reset(studio.start)
    yield page
    page.settle()
    assert page.errors == []
