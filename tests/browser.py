"""A headless Chromium with software rendering, which calls nobody."""

import os
import shutil
from collections.abc import Iterator

import pytest

__all__ = ["MISSING", "browser", "heard"]

CHROMIUM = shutil.which("chromium")
MISSING = "no chromium on this machine"

_FLAGS = (
    "--no-sandbox --use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader "
    "--disable-background-networking --disable-component-update --disable-default-apps "
    "--disable-sync --metrics-recording-only --no-first-run --no-pings --disable-gpu-compositing"
)
FLAGS = _FLAGS.split()


@pytest.fixture(scope="session")
def browser() -> Iterator[object]:
    if CHROMIUM is None:
        if os.environ.get("CI"):
            pytest.fail(MISSING)
        pytest.skip(MISSING)
    sync_api = pytest.importorskip("playwright.sync_api")
    with sync_api.sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=CHROMIUM, args=FLAGS)
        yield browser
        browser.close()


def heard(page) -> tuple[list[str], list[str]]:
    """What a page will complain of, and what it will request."""
    trouble, requests = [], []
    page.on("console", lambda message: trouble.append(message.text))
    page.on("pageerror", lambda error: trouble.append(str(error)))
    page.on("request", lambda request: requests.append(request.url))
    return trouble, requests
