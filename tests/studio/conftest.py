"""A studio with small clouds, and a headless Chromium that looks at it."""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator

import pytest

from softreach import designs
from softreach.studio import Quality, Start, Studio, StudioState
from tests.studio.tab import FLAGS, Tab

CHROMIUM = shutil.which("chromium")

SMALL = Quality(coarse_level=14, fine_level=15, coarse_accuracy=0.05, fine_accuracy=0.02)


@pytest.fixture(scope="session")
def studio() -> Iterator[Studio]:
    start = Start(
        state=StudioState(design=designs.minimal_trunk()).showing(level=14), quality=SMALL
    )
    with Studio(start) as running:
        yield running


@pytest.fixture(scope="session")
def browser() -> Iterator[object]:
    """Software rendering, and nothing that calls home."""
    if CHROMIUM is None:
        if os.environ.get("CI"):
            pytest.fail("chromium is missing: apt-get install chromium")
        pytest.skip("no chromium on this machine: apt-get install chromium")
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


@pytest.fixture(scope="module")
def tab(browser, studio) -> Iterator[Tab]:
    """One tab for a whole module: opening one takes seconds."""
    opened = Tab(browser, studio)
    yield opened
    opened.close()
